# A dataset as archives with a card, as SILVR publishes its own.


def pack_settings(wildcards):
    """Return the settings file of an archive: what is in it, its size, and what its card says."""
    name = packed_scene(wildcards)
    written = load_scene(name)
    content = {
        "datasets": [dataset.name for dataset in packed(wildcards)],
        "gigabytes": SETTINGS.package_gigabytes,
        "scene": written.model_dump(
            mode="json", include={"description", "licence", "credit"}
        ),
    }
    path = f"{WORK}/{wildcards.scene}/{wildcards.rig}/settings/pack.json"
    return settings_file(path, content)


rule pack:
    input:
        settings=pack_settings,
        sums=packed_sums,
    output:
        archive=f"{RESULTS}/{{scene}}/{{scene}}_{{rig}}.tar",
        card=f"{RESULTS}/{{scene}}/{{scene}}_{{rig}}.json",
    log:
        log_of("{scene}/{rig}/package"),
    conda:
        ENVIRONMENT
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
