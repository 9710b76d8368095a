# The same views through other lenses, by one lens map for each rig and reprojection.
from lightfield.geometry.lenses.cube_map import CUBE_FACES


rule reprojected_lightfield:
    input:
        PLAN.reads(
            "{scene}/{rig}/{reprojection}/lightfield",
            "reproject",
            lightfield=RUN.paths.lightfield,
        ),
    output:
        lightfield=update(RUN.paths.source_lightfield("{reprojection}/")),
        receipt=PLAN.receipt_of("{scene}/{rig}/{reprojection}/lightfield"),
    log:
        RUN.log_of("{scene}/{rig}/{reprojection}/lightfield"),
    benchmark:
        RUN.times_of("{scene}/{rig}/{reprojection}/lightfield")
    localrule: True
    params:
        views=RUN.paths.views,
        folder=RUN.paths.reprojected(),
    message:
        "Writing the lens of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {RUN.scripts}/reproject.py"
        " --dry-run --settings {input.settings}"
        " --input-cfg {input.lightfield} --output-cfg {output.lightfield}"
        " --input-dir {params.views} --output-dir {params.folder} --receipt {output.receipt}"
        " > {log} 2>&1"


rule lens_map:
    input:
        PLAN.reads(
            "{scene}/{rig}/{reprojection}/lens_map",
            "lens_map",
            lightfield=RUN.paths.lightfield,
        ),
    output:
        RUN.paths.lens_map(),
        receipt=PLAN.receipt_of("{scene}/{rig}/{reprojection}/lens_map"),
    log:
        RUN.log_of("{scene}/{rig}/{reprojection}/lens_map"),
    benchmark:
        RUN.times_of("{scene}/{rig}/{reprojection}/lens_map")
    localrule: True
    params:
        file=RUN.paths.lens_map(),
    message:
        "Computing the lens map of {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {RUN.scripts}/lens_map.py"
        " {params.file} --settings {input.settings} --input-cfg {input.lightfield}"
        " --receipt {output.receipt} > {log} 2>&1"


# For a cube map, the program adds the name of each face to the path.
use rule lens_map as lens_maps with:
    output:
        [RUN.paths.lens_map(face=face) for face in CUBE_FACES],
        receipt=PLAN.receipt_of("{scene}/{rig}/{reprojection}/lens_map"),
    # Snakemake does not take this from the other rule.
    localrule: True


rule reproject:
    input:
        PLAN.reads(
            "{scene}/{rig}/{reprojection}/{first}-{end}",
            "reproject",
            views=RUN.paths.receipt("render"),
            lightfield=RUN.paths.lightfield,
            lens_maps=RUN.of_build(RUN.build.lens_maps),
        ),
    output:
        receipt=PLAN.receipt_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
        bundle=PLAN.bundle_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
    log:
        RUN.log_of("{scene}/{rig}/{reprojection}/{first}-{end}"),
    benchmark:
        RUN.times_of("{scene}/{rig}/{reprojection}/{first}-{end}")
    resources:
        mem_mb=2000,
    params:
        views=RUN.paths.views,
        lens_map=RUN.paths.lens_map(),
        folder=RUN.paths.reprojected(),
    message:
        "Reprojecting views {wildcards.first} to {wildcards.end} of"
        " {wildcards.scene}/{wildcards.rig}/{wildcards.reprojection}"
    shell:
        f"python {RUN.scripts}/reproject.py"
        " --settings {input.settings}"
        " --lens-map {params.lens_map} --input-cfg {input.lightfield} --input-dir {params.views}"
        " --views {wildcards.first}:{wildcards.end} --output-dir {params.folder}"
        " --source-receipt {input.views} --receipt {output.receipt} > {log} 2>&1"
