# The same views through other lenses, by one lens map for each rig and reprojection.
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.workflow.jobs import LENS_MAP, RENDER, REPROJECT, REPROJECTED_LIGHTFIELD


rule reprojected_lightfield:
    input:
        PLAN.reads(
            REPROJECTED_LIGHTFIELD,
            lightfield=RUN.paths.lightfield,
        ),
    output:
        lightfield=update(RUN.paths.source_lightfield("{reprojection}/")),
        receipt=PLAN.receipt_of(REPROJECTED_LIGHTFIELD),
    log:
        RUN.log_of(REPROJECTED_LIGHTFIELD),
    benchmark:
        RUN.times_of(REPROJECTED_LIGHTFIELD)
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
            LENS_MAP,
            lightfield=RUN.paths.lightfield,
        ),
    output:
        RUN.paths.lens_map(),
        receipt=PLAN.receipt_of(LENS_MAP),
    log:
        RUN.log_of(LENS_MAP),
    benchmark:
        RUN.times_of(LENS_MAP)
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
        receipt=PLAN.receipt_of(LENS_MAP),
    # Snakemake does not take this from the other rule.
    localrule: True


rule reproject:
    input:
        PLAN.reads(
            REPROJECT,
            views=PLAN.receipt_path(RENDER.name),
            lightfield=RUN.paths.lightfield,
            lens_maps=RUN.of_build(RUN.build.lens_maps),
        ),
    output:
        receipt=PLAN.receipt_of(REPROJECT),
        bundle=PLAN.bundle_of(REPROJECT),
    log:
        RUN.log_of(REPROJECT),
    benchmark:
        RUN.times_of(REPROJECT)
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
