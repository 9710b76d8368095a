# Validation of datasets, and the checksums of all published files.
from lightfield.workflow.arguments import optional
from lightfield.workflow.jobs import CHECKSUMS, VALIDATE, VALIDATE_SEQUENCE


# An invalid dataset is an outcome too: it gets its validation.json, and fails below. It also gets its
# page, because the profile lets a run go on with other jobs after a failure (`keep-going`).
rule validate:
    input:
        PLAN.reads(
            VALIDATE,
            views=RUN.of_dataset("all_receipts"),
            published=RUN.of_dataset("published"),
            cameras=RUN.of_dataset("cameras"),
            inventory=RUN.of_dataset("inventory"),
            splits=RUN.of_dataset("splits"),
        ),
    output:
        validation=update(RUN.paths.validation),
        receipt=PLAN.receipt_of(VALIDATE),
    log:
        RUN.log_of(VALIDATE),
    benchmark:
        RUN.times_of(VALIDATE)
    wildcard_constraints:
        scene=RUN.scene_of_dataset,
    threads: 2
    resources:
        mem_mb=4000,
        runtime=RUN.at_most(120),
    params:
        dataset=RUN.paths.folder,
        optional=optional("inventory", "splits", clearance="cameras"),
        removed=RUN.removed,
    message:
        "Validating {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/validate.py"
        " {params.dataset} --settings {input.settings} {params.optional} --processes {threads}"
        " --removed {params.removed}"
        " --output {output.validation} --receipt {output.receipt} > {log} 2>&1"


rule checksums:
    input:
        PLAN.reads(
            CHECKSUMS,
            validation=RUN.paths.validation,
            receipts=RUN.of_dataset("all_receipts"),
            lists=RUN.of_dataset("published"),
        ),
    output:
        sums=update(RUN.paths.sums),
        receipt=PLAN.receipt_of(CHECKSUMS),
    log:
        RUN.log_of(CHECKSUMS),
    wildcard_constraints:
        scene=RUN.scene_of_dataset,
    localrule: True
    params:
        page=RUN.paths.page,
    message:
        "Publishing the checksums of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/publish_checksums.py"
        " --settings {input.settings} --validation {input.validation} --page {params.page}"
        " --output {output.sums} --receipt {output.receipt} > {log} 2>&1"


# The frames of a sequence are datasets. This is for the exports of all of them.
rule validate_sequence:
    input:
        PLAN.reads(
            VALIDATE_SEQUENCE,
            exports=RUN.of_build(RUN.build.sequence_exports),
            views=RUN.of_build(RUN.build.validated_frames),
        ),
    output:
        validation=update(RUN.paths.validation),
        sums=update(RUN.paths.sums),
        receipt=PLAN.receipt_of(VALIDATE_SEQUENCE),
    log:
        RUN.log_of(VALIDATE_SEQUENCE),
    benchmark:
        RUN.times_of(VALIDATE_SEQUENCE)
    wildcard_constraints:
        scene=RUN.scene_of_sequence,
        rig="[A-Za-z0-9_.-]+",
    resources:
        mem_mb=4000,
        runtime=RUN.at_most(120),
    params:
        rig=RUN.paths.folder,
        removed=RUN.removed,
    message:
        "Validating the sequence {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/validate_sequence.py"
        " {params.rig} --settings {input.settings} --removed {params.removed}"
        " --output {output.validation} --sums {output.sums} --receipt {output.receipt}"
        " > {log} 2>&1"


# The jobs that made the files are unknown when this is planned. It reads all files, also of an
# unfinished build. With a storage, it takes the finished datasets from there.
rule verify:
    log:
        RUN.log_of("verify"),
    params:
        verify=PLAN.verify_command,
    message:
        "Checking every byte of the chosen datasets"
    shell:
        "{params.verify} 2>&1 | tee {log}"
