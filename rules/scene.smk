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
        f"{WORK}/{{name}}/blend.sha256",
    log:
        f"{WORK}/logs/{{name}}/check_blend.log",
    conda:
        ENVIRONMENT
    params:
        sha256=lambda wildcards: source_of(wildcards.name)["sha256"],
    message:
        "Checking {input}"
    shell:
        "python scripts/check_blend.py --blend {input:q} --sha256 {params.sha256}"
        " --output {output} 2>&1 | tee {log}"
