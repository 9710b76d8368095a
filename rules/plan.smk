# A table before rendering: the estimated time and size of the views.
import shlex


rule probe:
    input:
        reads(
            "{scene}/{rig}/probe",
            check=of_dataset("blend_check"),
            blend=of_dataset("blend"),
            inventory=of_dataset("inventory"),
            lightfield=PATHS.lightfield,
        ),
    output:
        probe=update(PATHS.probe),
        receipt=receipt_of("{scene}/{rig}/probe"),
    log:
        log_of("{scene}/{rig}/probe"),
    resources:
        **GPU,
        mem_mb=6000,
        runtime=60,
    params:
        device=SETTINGS.device,
    message:
        "Measuring the time and size of the views of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/probe.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --output {output.probe}"
        " --receipt {output.receipt} > {log} 2>&1"


# It has no output, and answers on the terminal.
rule plan:
    input:
        [probe for _, _, probe in BUILD.probes],
    log:
        log_of("plan"),
    localrule: True
    params:
        datasets=" ".join(
            f"--dataset {name} {frames} {probe}"
            for name, frames, probe in BUILD.probes
        ),
        families=shlex.join(f"--family={folder}" for folder in BUILD.family_names),
        equal_error=equal_error_arguments(),
        watts=SETTINGS.energy.watts,
        cores=SETTINGS.energy.core_count,
        table=f"{RESULTS}/tables/plan.md",
    message:
        "Adding up the time and size of the chosen datasets"
    shell:
        f"python {SCRIPTS}/plan.py"
        " {params.datasets} {params.families} {params.equal_error}"
        " --watts {params.watts} --cores {params.cores} --output {params.table} 2>&1 | tee {log}"
