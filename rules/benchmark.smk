# Measurements that anybody can repeat. They are not part of a dataset: name the target.
from lightfield.workflow.arguments import optional, time_arguments_of_scene
from lightfield.workflow.jobs import GPU_CHECK

MEASURED = f"{RUN.results}/benchmarks"


rule reprojection_benchmark:
    output:
        multiext(f"{MEASURED}/reprojection", ".csv", ".svg"),
        report(
            f"{MEASURED}/reprojection.png",
            category="Measurements",
            caption="../captions/reprojection_benchmark.rst",
        ),
    log:
        RUN.log_of("reprojection_benchmark"),
    # Alone on the machine, so that nothing else is in the figures.
    threads: RUN.cores
    params:
        folder=subpath(output[0], parent=True),
    message:
        "Measuring the error of reprojection against its run time"
    shell:
        f"python {RUN.benchmarks}/reprojection.py"
        " {params.folder} --batch 8 > {log} 2>&1"


rule stability:
    output:
        multiext(f"{MEASURED}/stability", ".csv", ".md", ".svg"),
        report(
            f"{MEASURED}/stability.png",
            category="Measurements",
            caption="../captions/stability.rst",
        ),
    log:
        RUN.log_of("stability"),
    params:
        folder=subpath(output[0], parent=True),
    message:
        "Taking every pair of lenses to its extremes"
    shell:
        f"python {RUN.benchmarks}/stability.py" " --output {params.folder} > {log} 2>&1"


rule extremes:
    output:
        multiext(f"{MEASURED}/extremes", ".csv", ".md"),
    log:
        RUN.log_of("extremes"),
    params:
        folder=subpath(output[0], parent=True),
    message:
        "Rendering what is hard for a renderer"
    shell:
        f"python {RUN.benchmarks}/extremes.py" " --output {params.folder} > {log} 2>&1"


rule render_overhead:
    output:
        f"{MEASURED}/render_overhead.md",
    log:
        RUN.log_of("render_overhead"),
    threads: RUN.cores
    message:
        "Measuring what the workflow adds to Cycles' own render time"
    shell:
        f"python {RUN.benchmarks}/render_overhead.py" " > {output} 2> {log}"


rule check_gpu:
    input:
        PLAN.reads(
            GPU_CHECK,
            check=RUN.of_first("blend_check"),
            blend=RUN.of_first("blend"),
            inventory=RUN.of_first("inventory"),
            lightfield=RUN.paths.probes,
            calibration=RUN.of_first("calibration"),
        ),
    output:
        multiext(f"{MEASURED}/gpu_check/{{scene}}", ".json", ".md"),
        receipt=PLAN.receipt_of(GPU_CHECK),
    log:
        RUN.log_of(GPU_CHECK),
    # Alone on the machine, so that nothing else is in the times.
    threads: RUN.cores
    resources:
        **RUN.gpu,
        mem_mb=6000,
        runtime=RUN.at_most(60),
    params:
        device=RUN.settings.device,
        cache=RUN.of_first("paths.trials"),
        calibration=optional("calibration"),
        times=time_arguments_of_scene(RUN),
        stem=subpath(output[0], strip_suffix=".json"),
    message:
        "Comparing what the RUN.gpu and the processor make of {wildcards.scene}"
    shell:
        f"python {RUN.scripts}/gpu_check.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} {params.calibration} --device {params.device}"
        " --threads {threads} --settings {input.settings} {params.times}"
        " --cache {params.cache} --output {params.stem} --receipt {output.receipt}"
        " > {log} 2>&1"


# Without a RUN.gpu the run ends before its first job.
rule gpu_check:
    input:
        [f"{MEASURED}/gpu_check/{name}.json" for name in RUN.rendered_scenes],
        RUN.probes,
