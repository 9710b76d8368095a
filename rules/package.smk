# A dataset as archives with a card, as SILVR publishes its own.


rule pack:
    input:
        settings=settings("pack"),
        sums=of_build(BUILD.packed_sums),
        lists=of_build(BUILD.packed_lists) if STORE else [],
    output:
        archive=PATHS.package,
        card=PATHS.card,
    log:
        log_of("{scene}/{rig}/package"),
    params:
        folder=PATHS.folder,
    message:
        "Packing {output.archive}"
    shell:
        f"{taking('input')}python {SCRIPTS}/package.py"
        " --settings {input.settings} --folder {params.folder} --output {output.archive}"
        " > {log} 2>&1"


rule publish:
    input:
        settings=settings("pack"),
        sums=of_build(BUILD.packed_sums),
        lists=of_build(BUILD.packed_lists) if STORE else [],
    output:
        PATHS.documents,
    log:
        log_of("{scene}/{rig}/publish"),
    params:
        folder=PATHS.folder,
        output=subpath(output[0], parent=True),
    message:
        "Publishing {wildcards.scene}/{wildcards.rig} in {params.output}"
    shell:
        f"{taking('input')}python {SCRIPTS}/publish.py"
        " --settings {input.settings} --folder {params.folder} --output {params.output}"
        " > {log} 2>&1"
