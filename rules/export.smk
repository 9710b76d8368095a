# Files with which trainers open a dataset.


rule export_views_to_instant_ngp:
    input:
        records=records,
        lightfield=f"{DATASET}/lightfield.json",
        trained=trained_by,
    output:
        f"{DATASET}/transforms.json",
    log:
        log_of("{scene}/{rig}/export_instant_ngp"),
    benchmark:
        times_of("{scene}/{rig}/export/views")
    localrule: True
    conda:
        ENVIRONMENT
    params:
        views=f"{DATASET}/exr",
        options=instant_ngp_words,
    message:
        "Exporting {wildcards.scene}/{wildcards.rig} for instant-ngp"
    shell:
        f"{taking('input.records')}python {SCRIPTS}/export_instant_ngp.py"
        " --input-cfg {input.lightfield}"
        " --image-dir {params.views} --image-suffix .exr {params.options} --output {output}"
        " > {log} 2>&1"


rule export_reprojection_to_instant_ngp:
    input:
        records=records,
        lightfield=f"{REPROJECTED}/lightfield.json",
        trained=trained_by,
    output:
        f"{REPROJECTED}/transforms.json",
    log:
        log_of("{scene}/{rig}/{reprojection}/export_instant_ngp"),
    benchmark:
        times_of("{scene}/{rig}/export/{reprojection}")
    localrule: True
    conda:
        ENVIRONMENT
    params:
        suffix=of_reprojection("suffix"),
        options=instant_ngp_words,
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection} for instant-ngp"
    shell:
        f"{taking('input.records')}python {SCRIPTS}/export_instant_ngp.py"
        " --input-cfg {input.lightfield}"
        " --image-suffix {params.suffix} {params.options} --output {output} > {log} 2>&1"


rule export:
    input:
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
