# The same views through other lenses, by one lens map for each rig and reprojection.
from lightfield.geometry.lenses.cube_map import CUBE_FACES


rule reprojected_lightfield:
    input:
        reads(
            "{scene}/{rig}/{reprojection}/lightfield",
            "reproject",
            lightfield=PATHS.lightfield,
        ),
    output:
        lightfield=update(PATHS.source_lightfield("{reprojection}/")),
        receipt=receipt_of("{scene}/{rig}/{reprojection}/lightfield"),
    log:
        log_of("{scene}/{rig}/{reprojection}/lightfield"),
    benchmark:
        times_of("{scene}/{rig}/{reprojection}/lightfield")
    localrule: True
    params:
        views=PATHS.views,
        folder=PATHS.reprojected(),
    message:
        "Writing the lens of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {SCRIPTS}/reproject.py"
        " --dry-run --settings {input.settings}"
        " --input-cfg {input.lightfield} --output-cfg {output.lightfield}"
        " --input-dir {params.views} --output-dir {params.folder} --receipt {output.receipt}"
        " > {log} 2>&1"


rule lens_map:
    input:
        reads(
            "{scene}/{rig}/{reprojection}/lens_map",
            "lens_map",
            lightfield=PATHS.lightfield,
        ),
    output:
        PATHS.lens_map(),
        receipt=receipt_of("{scene}/{rig}/{reprojection}/lens_map"),
    log:
        log_of("{scene}/{rig}/{reprojection}/lens_map"),
    benchmark:
        times_of("{scene}/{rig}/{reprojection}/lens_map")
    localrule: True
    params:
        file=PATHS.lens_map(),
    message:
        "Computing the lens map of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {SCRIPTS}/lens_map.py"
        " {params.file} --settings {input.settings} --input-cfg {input.lightfield}"
        " --receipt {output.receipt} > {log} 2>&1"


# For a cube map, the program adds the name of each face to the path.
use rule lens_map as lens_maps with:
    output:
        [PATHS.lens_map(face=face) for face in CUBE_FACES],
        receipt=receipt_of("{scene}/{rig}/{reprojection}/lens_map"),
    # Snakemake does not take this from the other rule.
    localrule: True


rule reproject:
    input:
        reads(
            "{scene}/{rig}/{reprojection}/{first}-{end}",
            "reproject",
            views=PATHS.receipt("render"),
            lightfield=PATHS.lightfield,
            lens_maps=of_build(BUILD.lens_maps),
        ),
    output:
        receipt=receipt_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
        bundle=bundle_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
    log:
        log_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
    benchmark:
        times_of("{scene}/{rig}/{reprojection}/{first}-{end}")
    resources:
        mem_mb=2000,
    params:
        views=PATHS.views,
        lens_map=PATHS.lens_map(),
        folder=PATHS.reprojected(),
    message:
        "Reprojecting views {wildcards.first} to {wildcards.end} of"
        " {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {SCRIPTS}/reproject.py"
        " --settings {input.settings}"
        " --lens-map {params.lens_map} --input-cfg {input.lightfield} --input-dir {params.views}"
        " --views {wildcards.first}:{wildcards.end} --output-dir {params.folder}"
        " --source-receipt {input.views} --receipt {output.receipt} > {log} 2>&1"
