# The costs of a dataset, and the progress of a build.


rule costs:
    input:
        settings=settings("costs"),
        validation=PATHS.validation,
        # Without a store the validation is enough, and a plan of many shards is shorter.
        records=of_dataset("all_records") if STORE else [],
        published=of_dataset("published"),
        pictures=PATHS.pictures,
        blend=of_dataset("blend"),
        inventory=of_dataset("blend_inventory"),
    output:
        PATHS.costs,
    log:
        log_of("{scene}/{rig}/costs"),
    localrule: True
    params:
        dataset=subpath(output[0], ancestor=2),
        # These folders hold the journals and benchmarks of all earlier runs.
        journals=f"{PATHS.work}/render",
        benchmarks=f"{WORK}/benchmarks/{{scene}}/{{rig}}",
        # A calibration belongs to the preset, the scene itself to all of them.
        scene_benchmarks=of_dataset("scene_benchmarks"),
        blend=optional("blend"),
        inventory=optional("inventory"),
    message:
        "Adding up what {wildcards.scene}/{wildcards.rig} has cost"
    shell:
        f"{taking('input')}python {SCRIPTS}/costs.py"
        " --dataset {params.dataset} --journals {params.journals}"
        " --benchmarks {params.benchmarks} --scene-benchmarks {params.scene_benchmarks}"
        " {params.blend} --settings {input.settings} {params.inventory} --output {output} > {log} 2>&1"


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
        " {params.datasets} > {log} 2>&1"
