# A table before rendering: the estimated time and size of the views.
import shlex

from lightfield.workflow.arguments import equal_error_arguments, time_arguments
from lightfield.workflow.jobs import PROBE


rule probe:
    input:
        PLAN.reads(
            PROBE,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("inventory"),
            lightfield=RUN.paths.lightfield,
        ),
    output:
        probe=update(RUN.paths.probe),
        receipt=PLAN.receipt_of(PROBE),
    log:
        RUN.log_of(PROBE),
    resources:
        **RUN.gpu,
        mem_mb=6000,
        runtime=RUN.at_most(60),
    params:
        device=RUN.settings.device,
    message:
        "Measuring the time and size of the views of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/probe.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --output {output.probe}"
        " --receipt {output.receipt} > {log} 2>&1"


# It has no output, and answers on the terminal.
rule plan:
    input:
        [probe for _, _, probe in RUN.build.probes],
    log:
        RUN.log_of("plan"),
    localrule: True
    params:
        datasets=" ".join(
            f"--dataset {name} {frames} {probe}"
            for name, frames, probe in RUN.build.probes
        ),
        families=shlex.join(f"--family={folder}" for folder in RUN.build.family_names),
        equal_error=equal_error_arguments(RUN),
        times=time_arguments(RUN),
        watts=RUN.settings.energy.watts,
        cores=RUN.settings.energy.core_count,
        table=f"{RUN.results}/tables/plan.md",
    message:
        "Adding up the time and size of the chosen datasets"
    shell:
        f"python {RUN.scripts}/plan.py"
        " {params.datasets} {params.families} {params.equal_error} {params.times}"
        " --watts {params.watts} --cores {params.cores} --output {params.table} 2>&1 | tee {log}"
