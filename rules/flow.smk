# The optical flow from each view to its neighbour.
from lightfield.formats import passes
from lightfield.workflow.jobs import FLOW


rule flow:
    input:
        # A neighbour may belong to another shard.
        PLAN.reads(
            FLOW,
            views=RUN.of_build(RUN.build.receipts),
            lightfield=RUN.paths.lightfield,
        ),
    output:
        receipt=PLAN.receipt_of(FLOW),
        bundle=PLAN.bundle_of(FLOW),
    log:
        RUN.log_of(FLOW),
    benchmark:
        RUN.times_of(FLOW)
    resources:
        mem_mb=2000,
    params:
        folder=RUN.paths.reprojected(passes.FLOW.name),
    message:
        "Computing the flow of views {wildcards.first} to {wildcards.end} of"
        " {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/flow.py"
        " --settings {input.settings} --lightfield {input.lightfield} --views {wildcards.first}:{wildcards.end}"
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"
