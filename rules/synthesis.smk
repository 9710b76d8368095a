# The quality of views synthesised inside a light field. It is not part of a dataset: name the target.
from lightfield.workflow.jobs import SYNTHESIS


rule measure_synthesis:
    input:
        PLAN.reads(
            SYNTHESIS,
            views=RUN.of_build(RUN.build.rendered_receipts),
            truth=RUN.of_build(RUN.build.truth_receipts),
            lightfield=RUN.paths.lightfield,
        ),
    output:
        multiext(
            f"{RUN.results}/benchmarks/synthesis/{{scene}}/{{rig}}",
            ".csv",
            ".svg",
            ".png",
        ),
        receipt=PLAN.receipt_of(SYNTHESIS),
    log:
        RUN.log_of(SYNTHESIS),
    resources:
        mem_mb=4000,
    params:
        dataset=subpath(input.lightfield, parent=True),
        stem=subpath(output[0], strip_suffix=".csv"),
    message:
        "Measuring how well views of {wildcards.scene}/{wildcards.rig} are synthesised"
    shell:
        f"python {RUN.scripts}/synthesis_quality.py"
        " {params.dataset} --settings {input.settings} --output {params.stem}"
        " --receipt {output.receipt} > {log} 2>&1"


rule synthesis:
    input:
        [
            f"{RUN.results}/benchmarks/synthesis/{dataset.name}.csv"
            for dataset in RUN.chosen
            if dataset.depth
        ],
