# The views. One job renders one shard, and keeps every finished view.
from lightfield.workflow.jobs import RENDER
from lightfield.workflow.run import one_of


# Views that somebody else has rendered are imported unchanged.
ruleorder: import_views > render


rule import_views:
    input:
        PLAN.reads(RENDER, lightfield=RUN.paths.lightfield),
    output:
        receipt=PLAN.receipt_of(RENDER),
        bundle=PLAN.bundle_of(RENDER),
    log:
        RUN.log_of(RENDER),
    wildcard_constraints:
        scene=one_of(
            {d.scene_folder for d in RUN.build.datasets.values() if d.imported}
        ),
    # With a store, the views to import are on the machine that runs Snakemake.
    localrule: PLAN.is_stored
    params:
        dataset=RUN.of_dataset("imported"),
        folder=RUN.paths.views,
    message:
        "Importing views {wildcards.first} to {wildcards.end} of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/import_views.py"
        " --dataset {params.dataset:q} --lightfield {input.lightfield}"
        " --views {wildcards.first}:{wildcards.end} --output {params.folder} --receipt {output.receipt}"
        " > {log} 2>&1"


rule render:
    input:
        PLAN.reads(
            RENDER,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("inventory"),
            lightfield=RUN.paths.lightfield,
            cameras=RUN.paths.cameras,
        ),
    output:
        receipt=PLAN.receipt_of(RENDER),
        bundle=PLAN.bundle_of(RENDER),
    log:
        RUN.log_of(RENDER),
    benchmark:
        RUN.times_of(RENDER)
    threads: REQUESTS.threads_of_shard
    resources:
        **RUN.gpu,
        mem_mb=REQUESTS.memory_of(RENDER),
        runtime=REQUESTS.minutes_of(RENDER),
        stall_seconds=REQUESTS.stall_seconds,
    params:
        folder=RUN.paths.views,
        device=RUN.settings.device,
    message:
        "Rendering views {wildcards.first} to {wildcards.end} of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/render_shard.py"
        " --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --views {wildcards.first}:{wildcards.end} --device {params.device} --threads {threads}"
        " --output {params.folder} --receipt {output.receipt}"
        " --stall {resources.stall_seconds}"
        " > {log} 2>&1"
