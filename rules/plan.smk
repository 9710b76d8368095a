# Before anything is rendered: what the camera setups are, and what rendering them will take.


rule rig_tables:
    input:
        [
            f"configs/scenes/{name}.yaml"
            for name in dict.fromkeys(d.name for d in CHOSEN)
        ],
    output:
        markdown=f"{RESULTS}/tables/rigs.md",
        csv=f"{RESULTS}/tables/rigs.csv",
    log:
        f"{WORK}/logs/rig_tables.log",
    conda:
        ENVIRONMENT
    message:
        "Tabulating the camera setups"
    shell:
        "python scripts/rig_table.py {input} --markdown {output.markdown} --csv {output.csv}"
        " 2>&1 | tee {log}"


rule probe:
    input:
        check=scene_check,
        blend=scene_file,
        inventory=scene_inventory,
        lightfield=f"{DATASET}/lightfield.json",
    output:
        f"{MADE}/probe.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/probe.log",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=6000,
        runtime=60,
        gpu=0 if SETTINGS["device"] in ("auto", "cpu") else 1,
    params:
        device=SETTINGS["device"],
    message:
        "Measuring what the views of {wildcards.scene}/{wildcards.rig} cost"
    shell:
        "python scripts/probe.py --blend {input.blend:q} --inventory {input.inventory}"
        " --lightfield {input.lightfield} --device {params.device} --output {output}"
        " 2>&1 | tee {log}"


# Without output: it is asked for to be read.
rule plan:
    input:
        [probe for _, _, probe in probes()],
    log:
        f"{WORK}/logs/plan.log",
    conda:
        ENVIRONMENT
    params:
        datasets=" ".join(
            f"--dataset {name} {frames} {probe}" for name, frames, probe in probes()
        ),
        table=f"{RESULTS}/tables/plan.md",
    message:
        "Adding up what the chosen datasets will take"
    shell:
        "python scripts/plan.py {params.datasets} --output {params.table} 2>&1 | tee {log}"
