# Before anything is rendered: what the camera setups are, and what rendering them will take.


include: "helpers/plan.smk"


# Without output: it is asked for to be read.
rule rig_tables:
    input:
        [os.path.relpath(scene_path(name)) for name in CHOSEN_SCENES],
    log:
        log_of("rig_tables"),
    localrule: True
    params:
        table=f"{RESULTS}/tables/rigs.md",
        figures=f"{RESULTS}/tables/rigs.csv",
    message:
        "Tabulating the camera setups"
    shell:
        f"python {SCRIPTS}/rig_table.py"
        " {input} --markdown {params.table} --csv {params.figures}"
        " > {log} 2>&1"


rule probe:
    input:
        check=of_dataset("blend_check"),
        blend=of_dataset("blend"),
        inventory=of_dataset("inventory"),
        lightfield=f"{DATASET}/lightfield.json",
    output:
        f"{MADE}/probe.json",
    log:
        log_of("{scene}/{rig}/probe"),
    resources:
        mem_mb=6000,
        runtime=60,
        gpu=GPUS,
    params:
        device=SETTINGS.device,
    message:
        "Measuring what the views of {wildcards.scene}/{wildcards.rig} cost"
    shell:
        f"python {SCRIPTS}/probe.py"
        " --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --output {output}"
        " > {log} 2>&1"


# Without output: it is asked for to be read.
rule plan:
    input:
        [probe for _, _, probe in probes()],
    log:
        log_of("plan"),
    localrule: True
    params:
        datasets=" ".join(
            f"--dataset {name} {frames} {probe}" for name, frames, probe in probes()
        ),
        advice=advice_words(),
        table=f"{RESULTS}/tables/plan.md",
    message:
        "Adding up what the chosen datasets will take"
    shell:
        f"python {SCRIPTS}/plan.py"
        " {params.datasets} {params.advice} --output {params.table} > {log} 2>&1"
