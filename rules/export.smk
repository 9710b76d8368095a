# Files with which trainers open a dataset.


def export_settings(wildcards):
    """Return the settings file of an export: its options, and the rigs that test it."""
    dataset = dataset_of(wildcards)
    mark_stale_files(dataset.name)
    name = wildcards.get("format", "instant_ngp")
    source = wildcards.source.rstrip("/") or VIEWS
    reprojection = reprojection_of(wildcards)
    # A transforms.json can be asked for where the scene YAML has no such export.
    wanted = dataset.exports.wanted.get(name)
    testing = tested_by(wildcards) if "format" in wildcards.keys() else []
    content = {
        "options": wanted.recorded if wanted else {},
        "suffix": reprojection.suffix if reprojection else ".exr",
        "trained_by": dataset.trained_by,
        "tested_by": [other.rig_folder for other in testing],
    }
    return settings_file(
        f"{dataset.work}/settings/exports/{source}/{name}.json", content
    )


rule export_to_instant_ngp:
    input:
        settings=export_settings,
        records=records,
        lightfield=f"{DATASET}/{{source}}lightfield.json",
        trained=trained_by,
    output:
        f"{DATASET}/{{source}}transforms.json",
    log:
        log_of("{scene}/{rig}/{source}export_instant_ngp"),
    benchmark:
        times_of("{scene}/{rig}/export/{source}instant_ngp")
    localrule: True
    conda:
        ENVIRONMENT
    params:
        words=instant_ngp_words,
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for instant-ngp"
    shell:
        f"{taking('input.records')}python {SCRIPTS}/export_instant_ngp.py"
        " --input-cfg {input.lightfield} {params.words} --output {output} > {log} 2>&1"


rule export:
    input:
        settings=export_settings,
        views=exported_views,
        lightfield=f"{DATASET}/{{source}}lightfield.json",
        dataset=f"{DATASET}/lightfield.json",
    output:
        f"{DATASET}/{{source}}exports/{{format}}/{MANIFEST}",
    log:
        log_of("{scene}/{rig}/{source}export_{format}"),
    benchmark:
        times_of("{scene}/{rig}/export/{source}{format}")
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        dataset=subpath(input.dataset, parent=True),
        words=export_words,
        folder=subpath(output[0], parent=True),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for {wildcards.format}"
    shell:
        f"{taking('input.views')}python {SCRIPTS}/export.py"
        " {wildcards.format} --dataset {params.dataset} {params.words}"
        " --output {params.folder} > {log} 2>&1"
