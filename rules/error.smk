# Error: against render time, measured on request, and below a scene's target, which a scene YAML
# may give instead of samples.
from lightfield.workflow.arguments import optional
from lightfield.workflow.jobs import CALIBRATE, ERROR_VS_TIME, PROBE_CAMERAS


use rule lightfield as probe_cameras with:
    input:
        PLAN.reads(
            PROBE_CAMERAS,
            inventory=RUN.of_first("lightfield_inventory"),
            model=RUN.of_first("model_record"),
            places=RUN.of_first("places"),
        ),
    output:
        lightfield=update(RUN.paths.probes),
        receipt=PLAN.receipt_of(PROBE_CAMERAS),
    log:
        RUN.log_of(PROBE_CAMERAS),
    benchmark:
        RUN.times_of(PROBE_CAMERAS)
    localrule: True
    message:
        "Placing the probe cameras of {wildcards.scene}"


# Only scenes with a target error need this. Its output is reproducible, except for --seconds.
rule calibrate:
    input:
        PLAN.reads(
            CALIBRATE,
            check=RUN.of_first("blend_check"),
            blend=RUN.of_first("blend"),
            inventory=RUN.of_first("inventory"),
            lightfield=RUN.paths.probes,
        ),
    output:
        calibration=update(RUN.paths.calibration),
        receipt=PLAN.receipt_of(CALIBRATE),
    log:
        RUN.log_of(CALIBRATE),
    benchmark:
        RUN.times_of(CALIBRATE)
    threads: RUN.cores
    resources:
        **RUN.gpu,
        mem_mb=6000,
        runtime=RUN.at_most(240),
    params:
        device=RUN.settings.device,
        cache=RUN.of_first("paths.trials"),
        seconds=RUN.paths.calibration_seconds,
    message:
        "Choosing the settings that reach the target error of {wildcards.scene}"
    shell:
        f"python {RUN.scripts}/calibrate.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --threads {threads}"
        " --cache {params.cache} --output {output.calibration} --seconds {params.seconds}"
        " --receipt {output.receipt} > {log} 2>&1"


rule measure_error:
    input:
        PLAN.reads(
            ERROR_VS_TIME,
            check=RUN.of_first("blend_check"),
            blend=RUN.of_first("blend"),
            inventory=RUN.of_first("inventory"),
            lightfield=RUN.paths.probes,
            calibration=RUN.of_first("calibration"),
        ),
    output:
        multiext(
            f"{RUN.results}/benchmarks/error_vs_time/{{scene}}",
            ".json",
            ".csv",
            ".md",
            ".svg",
            ".png",
        ),
        receipt=PLAN.receipt_of(ERROR_VS_TIME),
    log:
        RUN.log_of(ERROR_VS_TIME),
    # Alone on the machine, and on one core of it, so that nothing else is in the times.
    threads: RUN.cores
    resources:
        **RUN.gpu,
        mem_mb=6000,
        runtime=RUN.at_most(240),
    params:
        device=RUN.settings.device,
        cache=RUN.of_first("paths.trials"),
        calibration=optional("calibration"),
        stem=subpath(output[0], strip_suffix=".json"),
    message:
        "Measuring error against render time in {wildcards.scene}"
    shell:
        f"python {RUN.scripts}/error_vs_time.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} {params.calibration} --device {params.device} --threads 1"
        " --cache {params.cache} --output {params.stem}"
        " --receipt {output.receipt} > {log} 2>&1"


rule error_vs_time:
    input:
        [
            f"{RUN.results}/benchmarks/error_vs_time/{name}.json"
            for name in RUN.rendered_scenes
        ],
        RUN.probes,
