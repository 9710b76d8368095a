# Where the cameras are and through which lens they look.


rule lightfield:
    input:
        check=scene_check,
        calibration=calibration,
    output:
        f"{DATASET}/lightfield.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/lightfield.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/cameras/lightfield.tsv"
    conda:
        ENVIRONMENT
    params:
        name=lambda wildcards: dataset_of(wildcards).name,
        limits=lambda wildcards: json.dumps(LIMITS[wildcards.scene]),
        calibration=calibration_words,
        # Not in the command: when what the YAML says of this dataset changes, so does the file.
        cameras=lambda wildcards: dataset_of(wildcards).cameras,
        render=lambda wildcards: dataset_of(wildcards).render,
        fingerprint=fingerprint,
    message:
        "Placing the cameras of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/make_lightfield.py --scene {params.name} --rig {wildcards.rig}"
        " --limits {params.limits:q} {params.calibration} --output {output} 2>&1 | tee {log}"


rule check_cameras:
    input:
        check=scene_check,
        blend=scene_file,
        lightfield=f"{DATASET}/lightfield.json",
    output:
        f"{MADE}/cameras.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/check_cameras.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/cameras/check_cameras.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=8000,
        runtime=60,
    message:
        "Looking for cameras of {wildcards.scene}/{wildcards.rig} inside geometry"
    shell:
        "python scripts/check_cameras.py --blend {input.blend:q} --lightfield {input.lightfield}"
        " --output {output} 2>&1 | tee {log}"
