# Files with which trainers open a dataset.


rule export_views_to_instant_ngp:
    input:
        records=lambda wildcards: records(dataset_of(wildcards), "render"),
        lightfield=f"{DATASET}/lightfield.json",
    output:
        f"{DATASET}/transforms.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/export_instant_ngp.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/export/views.tsv"
    conda:
        ENVIRONMENT
    params:
        views=f"{DATASET}/exr",
        placement=placement,
    message:
        "Exporting {wildcards.scene}/{wildcards.rig} for instant-ngp"
    shell:
        "python scripts/export_instant_ngp.py --input-cfg {input.lightfield}"
        " --image-dir {params.views} --image-suffix .exr {params.placement} --output {output}"
        " 2>&1 | tee {log}"


rule export_reprojection_to_instant_ngp:
    input:
        records=lambda wildcards: records(dataset_of(wildcards), wildcards.reprojection),
        lightfield=f"{REPROJECTED}/lightfield.json",
    output:
        f"{REPROJECTED}/transforms.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/{{reprojection}}/export_instant_ngp.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/export/{{reprojection}}.tsv"
    conda:
        ENVIRONMENT
    params:
        suffix=suffix,
        placement=placement,
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection} for instant-ngp"
    shell:
        "python scripts/export_instant_ngp.py --input-cfg {input.lightfield}"
        " --image-suffix {params.suffix} {params.placement} --output {output} 2>&1 | tee {log}"
