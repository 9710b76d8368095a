# The views. One job renders one shard, and keeps every finished view.


# Views that somebody else has rendered are imported unchanged.
ruleorder: import_views > render


rule import_views:
    input:
        reads("{scene}/{rig}/render/{first}-{end}", lightfield=PATHS.lightfield),
    output:
        receipt=receipt_of("{scene}/{rig}/render/{first}-{end}"),
        bundle=bundle_of("{scene}/{rig}/render/{first}-{end}"),
    log:
        log_of("{scene}/{rig}/render/{first}-{end}"),
    wildcard_constraints:
        scene=one_of({d.scene_folder for d in DATASETS.values() if d.imported}),
    # With a store, the views to import are on the machine that runs Snakemake.
    localrule: bool(STORE)
    params:
        dataset=of_dataset("imported"),
        folder=PATHS.views,
    message:
        "Importing views {wildcards.first} to {wildcards.end} of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/import_views.py"
        " --dataset {params.dataset:q} --lightfield {input.lightfield}"
        " --views {wildcards.first}:{wildcards.end} --output {params.folder} --receipt {output.receipt}"
        " > {log} 2>&1"


rule render:
    input:
        reads(
            "{scene}/{rig}/render/{first}-{end}",
            check=of_dataset("blend_check"),
            blend=of_dataset("blend"),
            inventory=of_dataset("inventory"),
            lightfield=PATHS.lightfield,
            cameras=PATHS.cameras,
        ),
    output:
        receipt=receipt_of("{scene}/{rig}/render/{first}-{end}"),
        bundle=bundle_of("{scene}/{rig}/render/{first}-{end}"),
    log:
        log_of("{scene}/{rig}/render/{first}-{end}"),
    benchmark:
        times_of("{scene}/{rig}/render/{first}-{end}")
    threads: threads_of_shard
    resources:
        **GPU,
        mem_mb=memory_of("render"),
        runtime=lambda wildcards, threads: cost_at("render", wildcards).most_minutes(
            threads
        ),
        stall_seconds=stall_seconds,
    params:
        folder=PATHS.views,
        device=SETTINGS.device,
    message:
        "Rendering views {wildcards.first} to {wildcards.end} of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/render_shard.py"
        " --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --views {wildcards.first}:{wildcards.end} --device {params.device} --threads {threads}"
        " --output {params.folder} --receipt {output.receipt}"
        " --stall {resources.stall_seconds}"
        " > {log} 2>&1"
