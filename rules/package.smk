# A dataset as archives with a card, as SILVR publishes its own.


include: "helpers/package.smk"


rule pack:
    input:
        settings=pack_settings,
        sums=packed_sums,
    output:
        archive=f"{RESULTS}/{{scene}}/{{scene}}_{{rig}}.tar",
        card=f"{RESULTS}/{{scene}}/{{scene}}_{{rig}}.json",
    log:
        log_of("{scene}/{rig}/package"),
    params:
        folder=f"{RESULTS}/{{scene}}/{{rig}}",
    message:
        "Packing {output.archive}"
    shell:
        f"{taking('input')}python {SCRIPTS}/package.py"
        " --settings {input.settings} --folder {params.folder} --output {output.archive}"
        " > {log} 2>&1"


rule publish:
    input:
        settings=pack_settings,
        sums=packed_sums,
    output:
        [f"{PUBLISHED}/{{scene}}_{{rig}}/{name}" for name in DOCUMENTS],
    log:
        log_of("{scene}/{rig}/publish"),
    params:
        folder=f"{RESULTS}/{{scene}}/{{rig}}",
        output=subpath(output[0], parent=True),
    message:
        "Publishing {wildcards.scene}/{wildcards.rig} in {params.output}"
    shell:
        f"{taking('input')}python {SCRIPTS}/publish.py"
        " --settings {input.settings} --folder {params.folder} --output {params.output}"
        " > {log} 2>&1"
