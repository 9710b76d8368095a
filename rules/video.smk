# A turntable or a walk, synthesised from the views.
from lightfield.workflow.jobs import VIDEO


rule video:
    input:
        PLAN.reads(
            VIDEO,
            views=RUN.of_build(RUN.build.rendered_receipts),
            lightfield=RUN.paths.lightfield,
        ),
    output:
        update(RUN.paths.video_list),
        receipt=PLAN.receipt_of(VIDEO),
        bundle=PLAN.bundle_of(VIDEO),
    log:
        RUN.log_of(VIDEO),
    benchmark:
        RUN.times_of(VIDEO)
    resources:
        mem_mb=6000,
        runtime=RUN.at_most(120),
    params:
        dataset=subpath(output[0], ancestor=2),
    message:
        "Making the video of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/video.py"
        " --dataset {params.dataset} --settings {input.settings}"
        " --output {params.dataset}/video --receipt {output.receipt} > {log} 2>&1"
