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
