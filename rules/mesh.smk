# The surface that cameras can see, as meshes.


rule mesh:
    input:
        settings=settings("mesh"),
        check=of_dataset("blend_check"),
        blend=of_dataset("blend"),
        inventory=of_dataset("inventory"),
    output:
        PATHS.mesh_list,
    log:
        log_of("{scene}/{rig}/mesh"),
    benchmark:
        times_of("{scene}/{rig}/mesh")
    resources:
        mem_mb=8000,
        runtime=60,
    params:
        folder=subpath(output[0], parent=True),
    message:
        "Writing the surface of {wildcards.scene}/{wildcards.rig} as meshes"
    shell:
        f"python {SCRIPTS}/surface.py"
        " --blend {input.blend:q} --settings {input.settings} --inventory {input.inventory}"
        " --output {params.folder} > {log} 2>&1"
