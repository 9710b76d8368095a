# The same views through other lenses, by one lens map for each rig and reprojection.


include: "helpers/reproject.smk"


lens_map_settings = reprojection_settings_of(
    "lens_map", lambda reprojection: reprojection.lens_map_settings
)
reproject_settings = reprojection_settings_of(
    "reproject", lambda reprojection: reprojection.as_json()
)


rule reprojected_lightfield:
    input:
        settings=reproject_settings,
        lightfield=f"{DATASET}/lightfield.json",
    output:
        f"{REPROJECTED}/lightfield.json",
    log:
        log_of("{scene}/{rig}/{reprojection}/lightfield"),
    benchmark:
        times_of("{scene}/{rig}/{reprojection}/lightfield")
    localrule: True
    params:
        views=f"{DATASET}/exr",
        folder=REPROJECTED,
    message:
        "Writing the lens of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {SCRIPTS}/reproject.py"
        " --dry-run --settings {input.settings}"
        " --input-cfg {input.lightfield} --output-cfg {output} --input-dir {params.views}"
        " --output-dir {params.folder} > {log} 2>&1"


rule lens_map:
    input:
        settings=lens_map_settings,
        lightfield=f"{DATASET}/lightfield.json",
    output:
        LENS_MAP,
    log:
        log_of("{scene}/{rig}/{reprojection}/lens_map"),
    benchmark:
        times_of("{scene}/{rig}/{reprojection}/lens_map")
    localrule: True
    params:
        file=LENS_MAP,
    message:
        "Computing the lens map of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {SCRIPTS}/lens_map.py"
        " {params.file} --settings {input.settings} --input-cfg {input.lightfield} > {log} 2>&1"


use rule lens_map as lens_maps with:
    output:
        expand(
            f"{MADE}/{{reprojection}}/lens_map_{{face}}.npy",
            face=CUBE_FACES,
            allow_missing=True,
        ),


rule reproject:
    input:
        record=f"{MADE}/render/{{first}}-{{end}}.json",
        lightfield=f"{DATASET}/lightfield.json",
        lens_maps=lens_maps_of,
        settings=reproject_settings,
    output:
        f"{MADE}/{{reprojection}}/{{first}}-{{end}}.json",
    log:
        log_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
    benchmark:
        times_of("{scene}/{rig}/{reprojection}/{first}-{end}")
    resources:
        mem_mb=2000,
    params:
        views=f"{DATASET}/exr",
        lens_map=LENS_MAP,
        folder=REPROJECTED,
    message:
        "Reprojecting views {wildcards.first} to {wildcards.end} of"
        " {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"{taking('input.record')}python {SCRIPTS}/reproject.py"
        " --settings {input.settings}"
        " --lens-map {params.lens_map} --input-cfg {input.lightfield} --input-dir {params.views}"
        " --views {wildcards.first}:{wildcards.end} --output-dir {params.folder}"
        " --source-record {input.record} --record {output} > {log} 2>&1"
