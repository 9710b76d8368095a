# Files with which trainers open a dataset.


rule export_views_to_instant_ngp:
    input:
        records=records,
        lightfield=f"{DATASET}/lightfield.json",
    output:
        f"{DATASET}/transforms.json",
    log:
        log_of("{scene}/{rig}/export_instant_ngp"),
    benchmark:
        times_of("{scene}/{rig}/export/views")
    conda:
        ENVIRONMENT
    params:
        views=f"{DATASET}/exr",
        placement=of_dataset("placement"),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig} for instant-ngp"
    shell:
        "python scripts/export_instant_ngp.py --input-cfg {input.lightfield}"
        " --image-dir {params.views} --image-suffix .exr {params.placement} --output {output}"
        " 2>&1 | tee {log}"


rule export_reprojection_to_instant_ngp:
    input:
        records=records,
        lightfield=f"{REPROJECTED}/lightfield.json",
    output:
        f"{REPROJECTED}/transforms.json",
    log:
        log_of("{scene}/{rig}/{reprojection}/export_instant_ngp"),
    benchmark:
        times_of("{scene}/{rig}/export/{reprojection}")
    conda:
        ENVIRONMENT
    params:
        suffix=of_reprojection("suffix"),
        placement=of_dataset("placement"),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection} for instant-ngp"
    shell:
        "python scripts/export_instant_ngp.py --input-cfg {input.lightfield}"
        " --image-suffix {params.suffix} {params.placement} --output {output} 2>&1 | tee {log}"
