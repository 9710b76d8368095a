# The surface that cameras can see, as meshes.
from lightfield.workflow.jobs import MESH


rule mesh:
    input:
        PLAN.reads(
            MESH,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("inventory"),
        ),
    output:
        update(RUN.paths.mesh_list),
        receipt=PLAN.receipt_of(MESH),
        bundle=PLAN.bundle_of(MESH),
    log:
        RUN.log_of(MESH),
    benchmark:
        RUN.times_of(MESH)
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(60),
    params:
        folder=subpath(output[0], parent=True),
    message:
        "Writing the surface of {wildcards.scene}/{wildcards.rig} as meshes"
    shell:
        f"python {RUN.scripts}/surface.py"
        " --blend {input.blend:q} --settings {input.settings} --inventory {input.inventory}"
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"
