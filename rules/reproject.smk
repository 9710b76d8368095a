# The same views through other lenses, by one lens map for each rig and reprojection.


rule reprojected_lightfield:
    input:
        f"{DATASET}/lightfield.json",
    output:
        f"{REPROJECTED}/lightfield.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/{{reprojection}}/lightfield.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/{{reprojection}}/lightfield.tsv"
    conda:
        ENVIRONMENT
    params:
        views=f"{DATASET}/exr",
        folder=REPROJECTED,
        optics=optics,
        development=development,
    message:
        "Writing the lens of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        "python scripts/reproject.py --dry-run {params.optics} {params.development}"
        " --input-cfg {input} --output-cfg {output} --input-dir {params.views}"
        " --output-dir {params.folder} 2>&1 | tee {log}"


rule lens_map:
    input:
        f"{DATASET}/lightfield.json",
    output:
        f"{MADE}/{{reprojection}}/lens_map.npy",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/{{reprojection}}/lens_map.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/{{reprojection}}/lens_map.tsv"
    conda:
        ENVIRONMENT
    params:
        optics=optics,
    message:
        "Computing the lens map of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        "python scripts/lens_map.py {output} {params.optics} --input-cfg {input} 2>&1 | tee {log}"


rule reproject:
    input:
        record=f"{MADE}/render/{{first}}-{{end}}.json",
        lightfield=f"{DATASET}/lightfield.json",
        lens_map=f"{MADE}/{{reprojection}}/lens_map.npy",
    output:
        f"{MADE}/{{reprojection}}/{{first}}-{{end}}.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/{{reprojection}}/{{first}}-{{end}}.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/{{reprojection}}/{{first}}-{{end}}.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=2000,
    params:
        views=f"{DATASET}/exr",
        folder=REPROJECTED,
        optics=optics,
        development=development,
    message:
        "Reprojecting views {wildcards.first} to {wildcards.end} of"
        " {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        "python scripts/reproject.py {params.optics} {params.development}"
        " --lens-map {input.lens_map} --input-cfg {input.lightfield} --input-dir {params.views}"
        " --views {wildcards.first}:{wildcards.end} --output-dir {params.folder}"
        " --record {output} 2>&1 | tee {log}"
