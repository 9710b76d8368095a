# The corners of calibration boards in each view.
from lightfield.workflow.arguments import optional
from lightfield.workflow.jobs import CORNERS


rule corners:
    input:
        PLAN.reads(
            CORNERS,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("blend_inventory"),
            lightfield=RUN.paths.lightfield,
        ),
    output:
        corners=update(RUN.paths.corners),
        receipt=PLAN.receipt_of(CORNERS),
    log:
        RUN.log_of(CORNERS),
    benchmark:
        RUN.times_of(CORNERS)
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(60),
    params:
        inventory=optional("inventory"),
    message:
        "Finding the corners of boards in the views of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/corners.py"
        " --blend {input.blend:q} --lightfield {input.lightfield} {params.inventory}"
        " --output {output.corners} --receipt {output.receipt} > {log} 2>&1"
