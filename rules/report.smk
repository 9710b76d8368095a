# What a dataset looks like.


rule panorama_lightfield:
    input:
        check=scene_check,
        calibration=calibration,
    output:
        f"{PANORAMA}/lightfield.json",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/panorama/lightfield.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/panorama/lightfield.tsv"
    conda:
        ENVIRONMENT
    params:
        name=lambda wildcards: dataset_of(wildcards).name,
        limits=lambda wildcards: json.dumps(LIMITS[wildcards.scene]),
        width=panorama_width,
        calibration=calibration_words,
        render=lambda wildcards: dataset_of(wildcards).render,
        center=lambda wildcards: dataset_of(wildcards).cameras["center"],
        fingerprint=fingerprint,
    message:
        "Placing the panorama of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/make_lightfield.py --scene {params.name} --rig {wildcards.rig}"
        " --limits {params.limits:q} --panorama {params.width} {params.calibration}"
        " --output {output} 2>&1 | tee {log}"


rule render_panorama:
    input:
        check=scene_check,
        blend=scene_file,
        inventory=scene_inventory,
        lightfield=f"{PANORAMA}/lightfield.json",
    output:
        f"{PANORAMA}/exr/view_0000f.exr",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/panorama/render.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/panorama/render.tsv"
    conda:
        ENVIRONMENT
    resources:
        mem_mb=6000,
        runtime=120,
        gpu=0 if SETTINGS["device"] in ("auto", "cpu") else 1,
    params:
        folder=f"{PANORAMA}/exr",
        device=SETTINGS["device"],
    message:
        "Rendering the panorama of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/render_shard.py --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --device {params.device} --threads {threads} --output {params.folder} 2>&1 | tee {log}"


rule panorama:
    input:
        f"{PANORAMA}/exr/view_0000f.exr",
    output:
        report(
            f"{DATASET}/report/panorama.png",
            category="{scene}",
            subcategory="{rig}",
            caption="../report/panorama.rst",
        ),
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/panorama/develop.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/panorama/develop.tsv"
    conda:
        ENVIRONMENT
    message:
        "Developing the panorama of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/develop.py --input {input} --output {output} 2>&1 | tee {log}"


rule contact_sheet:
    input:
        records=lambda wildcards: records(dataset_of(wildcards), "render"),
        lightfield=f"{DATASET}/lightfield.json",
    output:
        report(
            f"{DATASET}/report/contact_sheet.png",
            category="{scene}",
            subcategory="{rig}",
            caption="../report/contact_sheet.rst",
        ),
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/contact_sheet.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/report/contact_sheet.tsv"
    conda:
        ENVIRONMENT
    params:
        views=f"{DATASET}/exr",
    message:
        "Making the contact sheet of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/contact_sheet.py --lightfield {input.lightfield} --views {params.views}"
        " --output {output} 2>&1 | tee {log}"


rule figures:
    input:
        lightfield=f"{DATASET}/lightfield.json",
        panorama=f"{PANORAMA}/exr/view_0000f.exr",
    output:
        [f"{DATASET}/report/{still}.svg" for still in STILLS],
        [
            report(
                f"{DATASET}/report/{still}.png",
                category="{scene}",
                subcategory="{rig}",
                caption=f"../report/{still}.rst",
            )
            for still in STILLS
        ],
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/figures.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/report/figures.tsv"
    conda:
        ENVIRONMENT
    params:
        rig=lambda wildcards: json.dumps(dataset_of(wildcards).cameras),
        folder=lambda wildcards, output: str(Path(output[0]).parent),
    message:
        "Drawing the rig, depth and noise of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/report_figures.py --lightfield {input.lightfield} --rig {params.rig:q}"
        " --panorama {input.panorama} --output {params.folder} 2>&1 | tee {log}"


rule page:
    input:
        records=lambda wildcards: all_records(dataset_of(wildcards)),
        published=lambda wildcards: published(dataset_of(wildcards)),
        pictures=lambda wildcards: pictures(dataset_of(wildcards)),
        validation=f"{DATASET}/validation.json",
        costs=f"{DATASET}/report/costs.json",
    output:
        f"{DATASET}/report/index.html",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/page.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/report/page.tsv"
    conda:
        ENVIRONMENT
    params:
        dataset=lambda wildcards, output: str(Path(output[0]).parents[1]),
        rig=lambda wildcards: json.dumps(dataset_of(wildcards).cameras),
        measurements=measurements,
        # Not in the command: when a measurement was made anew, so is the page.
        measured=measurement_times,
    message:
        "Making the page of {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/report_html.py --dataset {params.dataset}"
        " --name {wildcards.scene}/{wildcards.rig} --rig {params.rig:q}"
        " --measurements {params.measurements} --output {output} 2>&1 | tee {log}"


rule index:
    input:
        [page_of(dataset) for dataset in CHOSEN],
    output:
        f"{RESULTS}/index.html",
    log:
        f"{WORK}/logs/index.log",
    conda:
        ENVIRONMENT
    params:
        results=lambda wildcards, output: str(Path(output[0]).parent),
    message:
        "Making the page of all datasets"
    shell:
        "python scripts/report_index.py --results {params.results} --output {output} 2>&1"
        " | tee {log}"
