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
        name=packed_scene,
        folder=f"{RESULTS}/{{scene}}/{{rig}}",
        size=(
            f"--gigabytes {SETTINGS.package_gigabytes}"
            if SETTINGS.package_gigabytes
            else ""
        ),
    message:
        "Packing {output.archive}"
    shell:
        f"{taking('input')}python {SCRIPTS}/package.py"
        " --scene {params.name} --folder {params.folder} {params.size} --output {output.archive}"
        " > {log} 2>&1"
