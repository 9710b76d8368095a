# The same views through other lenses, by one lens map for each rig and reprojection.
from lightfield.geometry.lenses.cube_map import CUBE_FACES


rule reprojected_lightfield:
    input:
        settings=settings("reproject"),
        lightfield=PATHS.lightfield,
    output:
        PATHS.source_lightfield("{reprojection}/"),
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
        " --input-cfg {input.lightfield} --output-cfg {output} --input-dir {params.views}"
        " --output-dir {params.folder} > {log} 2>&1"


rule lens_map:
    input:
        settings=settings("lens_map"),
        lightfield=PATHS.lightfield,
    output:
        PATHS.lens_map(),
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
        " {params.file} --settings {input.settings} --input-cfg {input.lightfield} > {log} 2>&1"


# For a cube map, the program adds the name of each face to the path.
use rule lens_map as lens_maps with:
    output:
        [PATHS.lens_map(face=face) for face in CUBE_FACES],
    # Snakemake does not take this from the other rule.
    localrule: True


rule reproject:
    input:
        record=PATHS.record("render"),
        lightfield=PATHS.lightfield,
        lens_maps=of_build(BUILD.lens_maps),
        settings=settings("reproject"),
    output:
        PATHS.record(),
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
        f"{taking('input.record')}python {SCRIPTS}/reproject.py"
        " --settings {input.settings}"
        " --lens-map {params.lens_map} --input-cfg {input.lightfield} --input-dir {params.views}"
        " --views {wildcards.first}:{wildcards.end} --output-dir {params.folder}"
        " --source-record {input.record} --record {output} > {log} 2>&1"
