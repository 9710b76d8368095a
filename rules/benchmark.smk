# Measurements that anybody can repeat; asked for by name, no part of a dataset.

MEASURED = f"{RESULTS}/benchmarks"


rule reprojection_benchmark:
    output:
        multiext(f"{MEASURED}/reprojection", ".csv", ".svg"),
        report(
            f"{MEASURED}/reprojection.png",
            category="Measurements",
            caption="../captions/reprojection_benchmark.rst",
        ),
    log:
        log_of("reprojection_benchmark"),
    conda:
        ENVIRONMENT
    # Alone on the machine, so that nothing else is in the figures.
    threads: lambda wildcards: workflow.cores
    params:
        folder=lambda wildcards, output: str(Path(output[0]).parent),
    message:
        "Measuring the error of reprojection against its run time"
    shell:
        f"python {BENCHMARKS}/reprojection.py" " {params.folder} --batch 8 > {log} 2>&1"


rule stability:
    output:
        multiext(f"{MEASURED}/stability", ".csv", ".md", ".svg"),
        report(
            f"{MEASURED}/stability.png",
            category="Measurements",
            caption="../captions/stability.rst",
        ),
    log:
        log_of("stability"),
    conda:
        ENVIRONMENT
    params:
        folder=lambda wildcards, output: str(Path(output[0]).parent),
    message:
        "Taking every pair of lenses to its extremes"
    shell:
        f"python {BENCHMARKS}/stability.py" " --output {params.folder} > {log} 2>&1"


rule render_overhead:
    output:
        f"{MEASURED}/render_overhead.md",
    log:
        log_of("render_overhead"),
    conda:
        ENVIRONMENT
    threads: lambda wildcards: workflow.cores
    message:
        "Measuring what the workflow adds to Cycles' own render time"
    shell:
        f"python {BENCHMARKS}/render_overhead.py" " > {output} 2> {log}"
