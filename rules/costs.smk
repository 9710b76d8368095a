# The costs of a dataset, and the progress of a build.
from lightfield.core.names import RENDERED
from lightfield.workflow.arguments import optional, status_arguments
from lightfield.workflow.jobs import COSTS


rule costs:
    input:
        PLAN.reads(
            COSTS,
            validation=RUN.paths.validation,
            published=RUN.of_dataset("published"),
            views=PLAN.only_stored(RUN.of_dataset("all_receipts")),
            pictures=RUN.paths.pictures,
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("blend_inventory"),
        ),
    output:
        costs=update(RUN.paths.costs),
        receipt=PLAN.receipt_of(COSTS),
    log:
        RUN.log_of(COSTS),
    localrule: True
    params:
        dataset=subpath(output.costs, ancestor=2),
        # These folders hold the history and the benchmarks of all earlier runs.
        receipts=f"{PLAN.receipts}/{{scene}}/{{rig}}/{RENDERED}",
        benchmarks=f"{RUN.work}/benchmarks/{{scene}}/{{rig}}",
        # A calibration belongs to the preset, the scene itself to all of them.
        scene_benchmarks=RUN.of_dataset("scene_benchmarks"),
        blend=optional("blend"),
        inventory=optional("inventory"),
    message:
        "Adding up what {wildcards.scene}/{wildcards.rig} has cost"
    shell:
        f"python {RUN.scripts}/costs.py"
        " --dataset {params.dataset} --receipts {params.receipts}"
        " --benchmarks {params.benchmarks} --scene-benchmarks {params.scene_benchmarks}"
        " {params.blend} --settings {input.settings} {params.inventory}"
        " --output {output.costs} --receipt {output.receipt} > {log} 2>&1"


# It has no input and no output, so that it can run at any time, even during a build.
rule status:
    log:
        RUN.log_of("status"),
    localrule: True
    params:
        results=RUN.results,
        work=RUN.work,
        datasets=status_arguments(PLAN),
    message:
        "Looking at the progress of the chosen datasets"
    shell:
        f"python {RUN.scripts}/status.py"
        " --results {params.results} --work {params.work}"
        " {params.datasets} 2>&1 | tee {log}"
