# Error: against render time, measured on request, and below a scene's target, which a scene YAML
# may give instead of samples.


# The probe cameras of the chosen scenes. Target rules name them, so that missing ones are made again.
PROBES = [f"{WORK}/{name}/probes.json" for name in RENDERED_SCENES]


use rule lightfield as probe_cameras with:
    input:
        reads(
            "{scene}/probe_cameras",
            "probes",
            inventory=of_first("lightfield_inventory"),
            model=of_first("model_record"),
            places=of_first("places"),
        ),
    output:
        lightfield=update(PATHS.probes),
        receipt=receipt_of("{scene}/probe_cameras"),
    log:
        log_of("{scene}/probe_cameras"),
    benchmark:
        times_of("{scene}/probe_cameras")
    localrule: True
    message:
        "Placing the probe cameras of {wildcards.scene}"


# Only scenes with a target error need this. Its output is reproducible, except for --seconds.
rule calibrate:
    input:
        reads(
            "{scene}/calibrate",
            check=of_first("blend_check"),
            blend=of_first("blend"),
            inventory=of_first("inventory"),
            lightfield=PATHS.probes,
        ),
    output:
        calibration=update(PATHS.calibration),
        receipt=receipt_of("{scene}/calibrate"),
    log:
        log_of("{scene}/calibrate"),
    benchmark:
        times_of("{scene}/calibrate")
    threads: ALL_CORES
    resources:
        **GPU,
        mem_mb=6000,
        runtime=240,
    params:
        device=SETTINGS.device,
        cache=of_first("paths.trials"),
        seconds=PATHS.calibration_seconds,
    message:
        "Choosing the settings that reach the target error of {wildcards.scene}"
    shell:
        f"python {SCRIPTS}/calibrate.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --threads {threads}"
        " --cache {params.cache} --output {output.calibration} --seconds {params.seconds}"
        " --receipt {output.receipt} > {log} 2>&1"


rule measure_error:
    input:
        reads(
            "{scene}/error_vs_time",
            check=of_first("blend_check"),
            blend=of_first("blend"),
            inventory=of_first("inventory"),
            lightfield=PATHS.probes,
            calibration=of_first("calibration"),
        ),
    output:
        multiext(
            f"{RESULTS}/benchmarks/error_vs_time/{{scene}}",
            ".json",
            ".csv",
            ".md",
            ".svg",
            ".png",
        ),
        receipt=receipt_of("{scene}/error_vs_time"),
    log:
        log_of("{scene}/error_vs_time"),
    # Alone on the machine, and on one core of it, so that nothing else is in the times.
    threads: ALL_CORES
    resources:
        **GPU,
        mem_mb=6000,
        runtime=240,
    params:
        device=SETTINGS.device,
        cache=of_first("paths.trials"),
        calibration=optional("calibration"),
        stem=subpath(output[0], strip_suffix=".json"),
    message:
        "Measuring error against render time in {wildcards.scene}"
    shell:
        f"python {SCRIPTS}/error_vs_time.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} {params.calibration} --device {params.device} --threads 1"
        " --cache {params.cache} --output {params.stem}"
        " --receipt {output.receipt} > {log} 2>&1"


rule error_vs_time:
    input:
        [f"{RESULTS}/benchmarks/error_vs_time/{name}.json" for name in RENDERED_SCENES],
        PROBES,
