# Error: against render time, measured on request, and below a scene's target, which a scene YAML
# may give instead of samples.


rule probe_cameras:
    input:
        check=lambda wildcards: check_of(scene_name(wildcards)),
    output:
        f"{WORK}/{{scene}}/probes.json",
    log:
        f"{WORK}/logs/{{scene}}/probe_cameras.log",
    conda:
        ENVIRONMENT
    params:
        name=scene_name,
        limits=lambda wildcards: json.dumps(scene_limits(wildcards)),
        # Not in the command: when what the YAML says changes, so does the file.
        cameras=lambda wildcards: first_dataset(wildcards).cameras,
        render=lambda wildcards: first_dataset(wildcards).render,
        fingerprint=lambda wildcards: fingerprint_of(first_dataset(wildcards)),
    message:
        "Placing the probe cameras of {wildcards.scene}"
    shell:
        "python scripts/make_lightfield.py --scene {params.name} --limits {params.limits:q}"
        " --output {output} 2>&1 | tee {log}"


# Only scenes with a target error ask for it. Its output is the same each time but for --seconds.
rule calibrate:
    input:
        check=lambda wildcards: check_of(scene_name(wildcards)),
        blend=lambda wildcards: blend_of(scene_name(wildcards)),
        inventory=lambda wildcards: f"{WORK}/{scene_name(wildcards)}/inventory.json",
        lightfield=f"{WORK}/{{scene}}/probes.json",
    output:
        f"{WORK}/{{scene}}/calibration.json",
    log:
        f"{WORK}/logs/{{scene}}/calibrate.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/calibrate.tsv"
    conda:
        ENVIRONMENT
    threads: lambda wildcards: workflow.cores or 1
    resources:
        mem_mb=6000,
        runtime=240,
        gpu=0 if SETTINGS["device"] in ("auto", "cpu") else 1,
    params:
        device=SETTINGS["device"],
        cache=lambda wildcards: f"{WORK}/{scene_name(wildcards)}/trials",
        seconds=f"{WORK}/{{scene}}/calibration_seconds.json",
    message:
        "Choosing the settings that reach the target error of {wildcards.scene}"
    shell:
        "python scripts/calibrate.py --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --threads {threads}"
        " --cache {params.cache} --output {output} --seconds {params.seconds} 2>&1 | tee {log}"


rule measure_error:
    input:
        check=lambda wildcards: check_of(scene_name(wildcards)),
        blend=lambda wildcards: blend_of(scene_name(wildcards)),
        inventory=lambda wildcards: f"{WORK}/{scene_name(wildcards)}/inventory.json",
        lightfield=f"{WORK}/{{scene}}/probes.json",
        calibration=lambda wildcards: calibration_of(first_dataset(wildcards)),
    output:
        multiext(
            f"{RESULTS}/benchmarks/error_vs_time/{{scene}}",
            ".json",
            ".csv",
            ".svg",
            ".png",
        ),
    log:
        f"{WORK}/logs/{{scene}}/error_vs_time.log",
    conda:
        ENVIRONMENT
    # Alone on the machine, and on one core of it, so that nothing else is in the times.
    threads: lambda wildcards: workflow.cores or 1
    resources:
        mem_mb=6000,
        runtime=240,
        gpu=0 if SETTINGS["device"] in ("auto", "cpu") else 1,
    params:
        device=SETTINGS["device"],
        cache=lambda wildcards: f"{WORK}/{scene_name(wildcards)}/trials",
        calibration=calibration_words,
        stem=lambda wildcards, output: str(Path(output[0]).with_suffix("")),
    message:
        "Measuring error against render time in {wildcards.scene}"
    shell:
        "python scripts/error_vs_time.py --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} {params.calibration} --device {params.device} --threads 1"
        " --cache {params.cache} --output {params.stem} 2>&1 | tee {log}"


rule error_vs_time:
    input:
        [
            f"{RESULTS}/benchmarks/error_vs_time/{name}.json"
            for name in dict.fromkeys(dataset.name for dataset in CHOSEN)
        ],
