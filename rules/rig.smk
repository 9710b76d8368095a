# The places of the cameras, and their lens.
from lightfield.workflow.arguments import optional
from lightfield.workflow.jobs import (
    CHECK_CAMERAS,
    FREE_PLACES,
    HEADS,
    LIGHTFIELD,
    SPLITS,
)


# Only a random rig's places depend on the scene.
rule free_places:
    input:
        PLAN.reads(
            FREE_PLACES,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("rig_inventory"),
        ),
    output:
        places=update(RUN.paths.places),
        receipt=PLAN.receipt_of(FREE_PLACES),
    log:
        RUN.log_of(FREE_PLACES),
    benchmark:
        RUN.times_of(FREE_PLACES)
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(60),
    params:
        inventory=optional("inventory"),
    message:
        "Looking for free places for the cameras of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/free_places.py"
        " --blend {input.blend:q} --settings {input.settings} {params.inventory}"
        " --output {output.places} --receipt {output.receipt} > {log} 2>&1"


rule lightfield:
    input:
        PLAN.reads(
            LIGHTFIELD,
            inventory=RUN.of_dataset("lightfield_inventory"),
            model=RUN.of_dataset("model_record"),
            calibration=RUN.of_dataset("calibration"),
            places=RUN.of_dataset("places"),
        ),
    output:
        lightfield=update(RUN.paths.lightfield),
        receipt=PLAN.receipt_of(LIGHTFIELD),
        bundle=PLAN.bundle_of(LIGHTFIELD),
    log:
        RUN.log_of(LIGHTFIELD),
    benchmark:
        RUN.times_of(LIGHTFIELD)
    localrule: True
    params:
        optional=optional("calibration", "places", "inventory", "model"),
    message:
        "Placing the cameras of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/make_lightfield.py"
        " --settings {input.settings} {params.optional} --output {output.lightfield}"
        " --receipt {output.receipt} > {log} 2>&1"


rule check_cameras:
    input:
        PLAN.reads(
            CHECK_CAMERAS,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("blend_inventory"),
            lightfield=RUN.paths.lightfield,
        ),
    output:
        cameras=update(RUN.paths.cameras),
        receipt=PLAN.receipt_of(CHECK_CAMERAS),
    log:
        RUN.log_of(CHECK_CAMERAS),
    benchmark:
        RUN.times_of(CHECK_CAMERAS)
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(60),
    params:
        inventory=optional("inventory"),
    message:
        "Looking for cameras of {wildcards.scene}/{wildcards.rig} inside geometry"
    shell:
        f"python {RUN.scripts}/check_cameras.py"
        " --blend {input.blend:q} --lightfield {input.lightfield} {params.inventory}"
        " --output {output.cameras} --receipt {output.receipt} > {log} 2>&1"


rule splits:
    input:
        PLAN.reads(SPLITS, lightfields=RUN.of_build(RUN.build.split_lightfields)),
    output:
        splits=update(RUN.paths.splits),
        receipt=PLAN.receipt_of(SPLITS),
    log:
        RUN.log_of(SPLITS),
    localrule: True
    message:
        "Listing what the views of {wildcards.scene} are for"
    shell:
        f"python {RUN.scripts}/splits.py"
        " --output {output.splits} --receipt {output.receipt} {input.lightfields} > {log} 2>&1"


rule heads:
    input:
        PLAN.reads(HEADS, lightfields=RUN.of_build(RUN.build.head_lightfields)),
    output:
        heads=update(RUN.paths.heads),
        receipt=PLAN.receipt_of(HEADS),
    log:
        RUN.log_of(HEADS),
    localrule: True
    message:
        "Listing the heads of {wildcards.scene}"
    shell:
        f"python {RUN.scripts}/heads.py"
        " --output {output.heads} --receipt {output.receipt} {input.lightfields} > {log} 2>&1"
