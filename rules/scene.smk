# A .blend: built by a scene builder, or brought by the user and checked.


rule build_scene:
    output:
        f"{WORK}/{{name}}/scene.blend",
    log:
        f"{WORK}/logs/{{name}}/build_scene.log",
    benchmark:
        f"{WORK}/benchmarks/{{name}}/build_scene.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=8000,
        runtime=30,
    params:
        builder=lambda wildcards: source_of(wildcards.name)["builder"],
        parameters=lambda wildcards: json.dumps(source_of(wildcards.name)["parameters"]),
        # Not in the command: a changed builder makes the scene, and then its views, anew.
        fingerprint=lambda wildcards: scene_fingerprint(source_of(wildcards.name)),
    message:
        "Building the scene {wildcards.name}"
    shell:
        "python scripts/build_scene.py --builder {params.builder}"
        " --parameters {params.parameters:q} --output {output} 2>&1 | tee {log}"


rule check_blend:
    input:
        lambda wildcards: source_of(wildcards.name)["blend"],
    output:
        f"{WORK}/{{name}}/blend.json",
    log:
        f"{WORK}/logs/{{name}}/check_blend.log",
    benchmark:
        f"{WORK}/benchmarks/{{name}}/check_blend.tsv"
    conda:
        ENVIRONMENT
    params:
        # Not in the command: with another bpy all that is made of the file is made anew.
        bpy=version("bpy"),
    message:
        "Checking {input}"
    shell:
        "python scripts/check_blend.py --scene {wildcards.name} --blend {input:q}"
        " --output {output} 2>&1 | tee {log}"


rule inventory:
    input:
        check=lambda wildcards: check_of(wildcards.name),
        blend=lambda wildcards: blend_of(wildcards.name),
    output:
        f"{WORK}/{{name}}/inventory.json",
    log:
        f"{WORK}/logs/{{name}}/inventory.log",
    benchmark:
        f"{WORK}/benchmarks/{{name}}/inventory.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=8000,
        runtime=30,
    message:
        "Listing what the scene {wildcards.name} contains"
    shell:
        "python scripts/inventory.py --blend {input.blend:q} --output {output} 2>&1 | tee {log}"


# Only where a scene YAML says from where, and the user has not brought the file.
for name, source in {
    dataset.name: dataset.source
    for dataset in DATASETS.values()
    if "url" in dataset.source
}.items():

    rule:
        name:
            f"fetch_{name}"
        output:
            source["blend"],
        log:
            f"{WORK}/logs/{name}/fetch_blend.log",
        # Where Snakemake runs: a cluster's nodes may not reach the Internet.
        localrule: True
        conda:
            ENVIRONMENT
        params:
            name=name,
        message:
            "Downloading {output}"
        shell:
            "python scripts/fetch_blend.py --scene {params.name} --output {output:q}"
            " 2>&1 | tee {log}"
