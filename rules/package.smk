# A dataset as archives with a card, as SILVR publishes its own.


rule pack:
    input:
        reads(
            "{scene}/{rig}/package",
            "pack",
            sums=of_build(BUILD.packed_sums),
            files=of_build(BUILD.packed_lists) if STORE else [],
        ),
    output:
        archive=PATHS.package,
        card=update(PATHS.card),
        receipt=receipt_of("{scene}/{rig}/package"),
        bundle=bundle_of("{scene}/{rig}/package"),
    log:
        log_of("{scene}/{rig}/package"),
    params:
        folder=PATHS.folder,
    message:
        "Packing {output.archive}"
    shell:
        f"python {SCRIPTS}/package.py"
        " --settings {input.settings} --folder {params.folder} --output {output.archive}"
        " --receipt {output.receipt} > {log} 2>&1"


rule publish:
    input:
        reads(
            "{scene}/{rig}/publish",
            "pack",
            sums=of_build(BUILD.packed_sums),
            files=of_build(BUILD.packed_lists) if STORE else [],
        ),
    output:
        [update(document) for document in PATHS.documents],
        receipt=receipt_of("{scene}/{rig}/publish"),
        bundle=bundle_of("{scene}/{rig}/publish"),
    log:
        log_of("{scene}/{rig}/publish"),
    params:
        folder=PATHS.folder,
        output=subpath(output[0], parent=True),
    message:
        "Publishing {wildcards.scene}/{wildcards.rig} in {params.output}"
    shell:
        f"python {SCRIPTS}/publish.py"
        " --settings {input.settings} --folder {params.folder} --output {params.output}"
        " --receipt {output.receipt} > {log} 2>&1"
