# Validation of datasets, and the checksums of all published files.


# An invalid dataset is an outcome too: it gets its validation.json, and fails below. It also gets its
# page, because the profile lets a run go on with other jobs after a failure (`keep-going`).
rule validate:
    input:
        reads(
            "{scene}/{rig}/validate",
            "validate",
            views=of_dataset("all_receipts"),
            published=of_dataset("published"),
            cameras=of_dataset("cameras"),
            inventory=of_dataset("inventory"),
            splits=of_dataset("splits"),
        ),
    output:
        validation=update(PATHS.validation),
        receipt=receipt_of("{scene}/{rig}/validate"),
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
    message:
        "Validating {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/validate.py"
        " {params.dataset} --settings {input.settings} {params.optional} --processes {threads}"
        " --removed {params.removed}"
        " --output {output.validation} --receipt {output.receipt} > {log} 2>&1"


rule checksums:
    input:
        reads(
            "{scene}/{rig}/checksums",
            "checksums",
            validation=PATHS.validation,
            receipts=of_dataset("all_receipts"),
            lists=of_dataset("published"),
        ),
    output:
        sums=update(PATHS.sums),
        receipt=receipt_of("{scene}/{rig}/checksums"),
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
        " --settings {input.settings} --validation {input.validation} --page {params.page}"
        " --output {output.sums} --receipt {output.receipt} > {log} 2>&1"


# The frames of a sequence are datasets. This is for the exports of all of them.
rule validate_sequence:
    input:
        reads(
            "{scene}/{rig}/validate_sequence",
            "validate_sequence",
            exports=of_build(BUILD.sequence_exports),
            views=of_build(BUILD.validated_frames),
        ),
    output:
        validation=update(PATHS.validation),
        sums=update(PATHS.sums),
        receipt=receipt_of("{scene}/{rig}/validate_sequence"),
    log:
        log_of("{scene}/{rig}/validate_sequence"),
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
        f"python {SCRIPTS}/validate_sequence.py"
        " {params.rig} --settings {input.settings} --removed {params.removed}"
        " --output {output.validation} --sums {output.sums} --receipt {output.receipt}"
        " > {log} 2>&1"


# The jobs that made the files are unknown when this is planned. It reads all files, also of an
# unfinished build. With a storage, it takes the finished datasets from there.
rule verify:
    log:
        log_of("verify"),
    params:
        verify=verify_command,
    message:
        "Checking every byte of the chosen datasets"
    shell:
        "{params.verify} 2>&1 | tee {log}"
