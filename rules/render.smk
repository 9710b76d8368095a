# The views: one job renders one shard, and keeps every view that is already there and right.


rule render:
    input:
        check=scene_check,
        blend=scene_file,
        inventory=scene_inventory,
        lightfield=f"{DATASET}/lightfield.json",
        cameras=f"{MADE}/cameras.json",
    output:
        f"{MADE}/render/{{first}}-{{end}}.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/render/{{first}}-{{end}}.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/render/{{first}}-{{end}}.tsv"
    conda:
        ENVIRONMENT
    threads: shard_threads
    resources:
        mem_mb=6000,
        runtime=lambda wildcards: shard_minutes(wildcards),
        gpu=0 if SETTINGS["device"] in ("auto", "cpu") else 1,
    params:
        folder=f"{DATASET}/exr",
        journal=f"{MADE}/render/{{first}}-{{end}}.journal.jsonl",
        device=SETTINGS["device"],
        run=RUN,
    message:
        "Rendering views {wildcards.first} to {wildcards.end} of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/render_shard.py --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --views {wildcards.first}:{wildcards.end} --device {params.device} --threads {threads}"
        " --output {params.folder} --journal {params.journal} --record {output}"
        " --run {params.run}"
        " 2>&1 | tee {log}"
