# The costs of a dataset, and the progress of a build.


rule costs:
    input:
        reads(
            "{scene}/{rig}/costs",
            "costs",
            validation=PATHS.validation,
            published=of_dataset("published"),
            views=of_dataset("all_receipts") if STORE else [],
            pictures=PATHS.pictures,
            blend=of_dataset("blend"),
            inventory=of_dataset("blend_inventory"),
        ),
    output:
        costs=update(PATHS.costs),
        receipt=receipt_of("{scene}/{rig}/costs"),
    log:
        log_of("{scene}/{rig}/costs"),
    localrule: True
    params:
        dataset=subpath(output.costs, ancestor=2),
        # These folders hold the history and the benchmarks of all earlier runs.
        receipts=f"{RECEIPTS}/{{scene}}/{{rig}}/render",
        benchmarks=f"{WORK}/benchmarks/{{scene}}/{{rig}}",
        # A calibration belongs to the preset, the scene itself to all of them.
        scene_benchmarks=of_dataset("scene_benchmarks"),
        blend=optional("blend"),
        inventory=optional("inventory"),
    message:
        "Adding up what {wildcards.scene}/{wildcards.rig} has cost"
    shell:
        f"python {SCRIPTS}/costs.py"
        " --dataset {params.dataset} --receipts {params.receipts}"
        " --benchmarks {params.benchmarks} --scene-benchmarks {params.scene_benchmarks}"
        " {params.blend} --settings {input.settings} {params.inventory}"
        " --output {output.costs} --receipt {output.receipt} > {log} 2>&1"


# It has no input and no output, so that it can run at any time, even during a build.
rule status:
    log:
        log_of("status"),
    localrule: True
    params:
        results=RESULTS,
        work=WORK,
        datasets=status_arguments,
    message:
        "Looking at the progress of the chosen datasets"
    shell:
        f"python {SCRIPTS}/status.py"
        " --results {params.results} --work {params.work}"
        " {params.datasets} 2>&1 | tee {log}"
