# The places of the cameras, and their lens.


# Only a random rig's places depend on the scene.
rule free_places:
    input:
        reads(
            "{scene}/{rig}/free_places",
            "free_places",
            check=of_dataset("blend_check"),
            blend=of_dataset("blend"),
            inventory=of_dataset("blend_inventory"),
        ),
    output:
        places=update(PATHS.places),
        receipt=receipt_of("{scene}/{rig}/free_places"),
    log:
        log_of("{scene}/{rig}/free_places"),
    benchmark:
        times_of("{scene}/{rig}/cameras/free_places")
    resources:
        mem_mb=8000,
        runtime=60,
    params:
        inventory=optional("inventory"),
    message:
        "Looking for free places for the cameras of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/free_places.py"
        " --blend {input.blend:q} --settings {input.settings} {params.inventory}"
        " --output {output.places} --receipt {output.receipt} > {log} 2>&1"


rule lightfield:
    input:
        reads(
            "{scene}/{rig}/lightfield",
            "lightfield",
            inventory=of_dataset("lightfield_inventory"),
            model=of_dataset("model_record"),
            calibration=of_dataset("calibration"),
            places=of_dataset("places"),
        ),
    output:
        lightfield=update(PATHS.lightfield),
        receipt=receipt_of("{scene}/{rig}/lightfield"),
    log:
        log_of("{scene}/{rig}/lightfield"),
    benchmark:
        times_of("{scene}/{rig}/cameras/lightfield")
    localrule: True
    params:
        optional=optional("calibration", "places", "inventory", "model"),
    message:
        "Placing the cameras of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/make_lightfield.py"
        " --settings {input.settings} {params.optional} --output {output.lightfield}"
        " --receipt {output.receipt} > {log} 2>&1"


rule check_cameras:
    input:
        reads(
            "{scene}/{rig}/check_cameras",
            check=of_dataset("blend_check"),
            blend=of_dataset("blend"),
            inventory=of_dataset("blend_inventory"),
            lightfield=PATHS.lightfield,
        ),
    output:
        cameras=update(PATHS.cameras),
        receipt=receipt_of("{scene}/{rig}/check_cameras"),
    log:
        log_of("{scene}/{rig}/check_cameras"),
    benchmark:
        times_of("{scene}/{rig}/cameras/check_cameras")
    resources:
        mem_mb=8000,
        runtime=60,
    params:
        inventory=optional("inventory"),
    message:
        "Looking for cameras of {wildcards.scene}/{wildcards.rig} inside geometry"
    shell:
        f"python {SCRIPTS}/check_cameras.py"
        " --blend {input.blend:q} --lightfield {input.lightfield} {params.inventory}"
        " --output {output.cameras} --receipt {output.receipt} > {log} 2>&1"


rule splits:
    input:
        reads("{scene}/splits", lightfields=of_build(BUILD.split_lightfields)),
    output:
        splits=update(PATHS.splits),
        receipt=receipt_of("{scene}/splits"),
    log:
        log_of("{scene}/splits"),
    localrule: True
    message:
        "Listing what the views of {wildcards.scene} are for"
    shell:
        f"python {SCRIPTS}/splits.py"
        " --output {output.splits} --receipt {output.receipt} {input.lightfields} > {log} 2>&1"
