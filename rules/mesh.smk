# The surface that cameras can see, as meshes.


rule mesh:
    input:
        PLAN.reads(
            "{scene}/{rig}/mesh",
            "mesh",
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("inventory"),
        ),
    output:
        update(RUN.paths.mesh_list),
        receipt=PLAN.receipt_of("{scene}/{rig}/mesh"),
        bundle=PLAN.bundle_of("{scene}/{rig}/mesh"),
    log:
        RUN.log_of("{scene}/{rig}/mesh"),
    benchmark:
        RUN.times_of("{scene}/{rig}/mesh")
    resources:
        mem_mb=8000,
        runtime=60,
    params:
        folder=subpath(output[0], parent=True),
    message:
        "Writing the surface of {wildcards.scene}/{wildcards.rig} as meshes"
    shell:
        f"python {RUN.scripts}/surface.py"
        " --blend {input.blend:q} --settings {input.settings} --inventory {input.inventory}"
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"
