# The surface that cameras can see, as meshes.


rule mesh:
    input:
        reads(
            "{scene}/{rig}/mesh",
            "mesh",
            check=of_dataset("blend_check"),
            blend=of_dataset("blend"),
            inventory=of_dataset("inventory"),
        ),
    output:
        update(PATHS.mesh_list),
        receipt=receipt_of("{scene}/{rig}/mesh"),
        bundle=bundle_of("{scene}/{rig}/mesh"),
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
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"
