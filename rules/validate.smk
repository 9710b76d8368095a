# Validation of datasets, and the checksums of all published files.


# An invalid dataset is an outcome too: it gets its validation.json, and fails below. It also gets its
# page, because the profile lets a run go on with other jobs after a failure (`keep-going`).
rule validate:
    input:
        settings=settings("validate"),
        records=of_dataset("all_records"),
        published=of_dataset("published"),
        cameras=of_dataset("cameras"),
        inventory=of_dataset("inventory"),
        splits=of_dataset("splits"),
    output:
        validation=PATHS.validation,
        sums=PATHS.checksums,
    log:
        log_of("{scene}/{rig}/validate"),
    benchmark:
        times_of("{scene}/{rig}/validate")
    wildcard_constraints:
        scene=SCENE_OF_DATASET,
    threads: 2
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        dataset=PATHS.folder,
        optional=optional("inventory", "splits", clearance="cameras"),
        removed=REMOVED,
        # The storage has its own copies of what other machines made.
        ledger=f"--ledger {LEDGER}" if not STORE else "",
    message:
        "Validating {wildcards.scene}/{wildcards.rig}"
    shell:
        f"{taking('input')}python {SCRIPTS}/validate.py"
        " {params.dataset} --settings {input.settings} {params.optional} --processes {threads}"
        " --removed {params.removed} {params.ledger}"
        " --output {output.validation} --sums {output.sums} > {log} 2>&1"


rule checksums:
    input:
        validation=PATHS.validation,
        sums=PATHS.checksums,
    output:
        PATHS.sums,
    log:
        log_of("{scene}/{rig}/checksums"),
    wildcard_constraints:
        scene=SCENE_OF_DATASET,
    localrule: True
    params:
        page=PATHS.page,
    message:
        "Publishing the checksums of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/publish_checksums.py"
        " --validation {input.validation} --page {params.page}"
        " --sums {input.sums} --output {output} > {log} 2>&1"


# The frames of a sequence are datasets. This is for the exports of all of them.
rule validate_sequence:
    input:
        settings=settings("validate_sequence"),
        exports=of_build(BUILD.sequence_exports),
        views=of_build(BUILD.validated_frames),
    output:
        validation=PATHS.validation,
        sums=PATHS.sums,
    log:
        log_of("{scene}/{rig}/validate"),
    benchmark:
        times_of("{scene}/{rig}/validate")
    wildcard_constraints:
        scene=SCENE_OF_SEQUENCE,
        rig="[A-Za-z0-9_.-]+",
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        rig=PATHS.folder,
        removed=REMOVED,
    message:
        "Validating the sequence {wildcards.scene}/{wildcards.rig}"
    shell:
        f"{taking('input')}python {SCRIPTS}/validate_sequence.py"
        " {params.rig} --settings {input.settings} --removed {params.removed}"
        " --output {output.validation} --sums {output.sums} > {log} 2>&1"


# The jobs that made the files are unknown when this is planned. It reads all files, also those of an
# unfinished build. With a view store, it first fetches the files.
rule verify:
    input:
        stored_lists,
    log:
        log_of("verify"),
    params:
        verify=verify_command,
    message:
        "Checking every byte of the chosen datasets"
    shell:
        f"{taking('input')}{{params.verify}} > {{log}} 2>&1"
