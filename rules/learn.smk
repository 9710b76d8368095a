# Radiance fields that learn from exported files. They are not part of a dataset: name the target.
import os
import shlex
from pathlib import Path

from lightfield.workflow.build import learned_exports

# The environment that has torch.
CONSUMERS = FOLDER / ".venv-consumers"
CONSUMERS_PYTHON = shlex.quote(os.path.relpath(CONSUMERS / "bin/python"))


rule measure_learning:
    input:
        consumers=consumers,
        exports=of_build(BUILD.learned_from),
    output:
        multiext(
            f"{RESULTS}/benchmarks/learn/{{scene}}/{{rig}}", ".csv", ".svg", ".png"
        ),
    log:
        log_of("{scene}/{rig}/learn"),
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
        f"{CONSUMERS_PYTHON} {BENCHMARKS}/learn.py"
        " {params.folders} --output {params.stem} > {log} 2>&1"


rule learn:
    input:
        [
            f"{RESULTS}/benchmarks/learn/{dataset.name}.csv"
            for dataset in CHOSEN_DATASETS
            if learned_exports(dataset)
        ],
