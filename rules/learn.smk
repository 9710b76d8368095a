# Radiance fields that learn from exported files. They are not part of a dataset: name the target.
from pathlib import Path

from lightfield.workflow.build import learned_exports


rule measure_learning:
    input:
        consumers=RUN.consumers_of,
        exports=RUN.of_build(RUN.build.learned_from),
    output:
        multiext(
            f"{RUN.results}/benchmarks/learn/{{scene}}/{{rig}}", ".csv", ".svg", ".png"
        ),
    log:
        RUN.log_of("{scene}/{rig}/learn"),
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        folders=lambda wildcards, input: [
            str(Path(path).parent) for path in input.exports
        ],
        stem=subpath(output[0], strip_suffix=".csv"),
    message:
        "Learning what the exports of {wildcards.scene}/{wildcards.rig} show"
    shell:
        f"{RUN.consumers_python} {RUN.benchmarks}/learn.py"
        " {params.folders} --output {params.stem} > {log} 2>&1"


rule learn:
    input:
        [
            f"{RUN.results}/benchmarks/learn/{dataset.name}.csv"
            for dataset in RUN.chosen
            if learned_exports(dataset)
        ],
