# The quality of views synthesised inside a light field. It is not part of a dataset: name the target.


rule measure_synthesis:
    input:
        reads(
            "{scene}/{rig}/synthesis",
            "synthesis",
            views=of_build(BUILD.rendered_receipts),
            truth=of_build(BUILD.truth_receipts),
            lightfield=PATHS.lightfield,
        ),
    output:
        multiext(
            f"{RESULTS}/benchmarks/synthesis/{{scene}}/{{rig}}", ".csv", ".svg", ".png"
        ),
        receipt=receipt_of("{scene}/{rig}/synthesis"),
    log:
        log_of("{scene}/{rig}/synthesis"),
    resources:
        mem_mb=4000,
    params:
        dataset=subpath(input.lightfield, parent=True),
        stem=subpath(output[0], strip_suffix=".csv"),
    message:
        "Measuring how well views of {wildcards.scene}/{wildcards.rig} are synthesised"
    shell:
        f"python {SCRIPTS}/synthesis_quality.py"
        " {params.dataset} --settings {input.settings} --output {params.stem}"
        " --receipt {output.receipt} > {log} 2>&1"


rule synthesis:
    input:
        [
            f"{RESULTS}/benchmarks/synthesis/{dataset.name}.csv"
            for dataset in CHOSEN_DATASETS
            if dataset.depth
        ],
