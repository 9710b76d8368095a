# Pictures and pages of datasets.
from lightfield.configuration.dataset_paths import PICTURES, PLOTS


use rule lightfield as panorama_lightfield with:
    input:
        reads(
            "{scene}/{rig}/panorama/lightfield",
            "panorama",
            inventory=of_dataset("blend_inventory"),
            model=of_dataset("model_record"),
            calibration=of_dataset("calibration"),
        ),
    output:
        lightfield=update(PATHS.panorama_lightfield),
        receipt=receipt_of("{scene}/{rig}/panorama/lightfield"),
    log:
        log_of("{scene}/{rig}/panorama/lightfield"),
    benchmark:
        times_of("{scene}/{rig}/panorama/lightfield")
    localrule: True
    message:
        "Placing the panorama of {wildcards.scene}/{wildcards.rig}"


rule render_panorama:
    input:
        reads(
            "{scene}/{rig}/panorama/render",
            check=of_dataset("blend_check"),
            blend=of_dataset("blend"),
            inventory=of_dataset("inventory"),
            lightfield=PATHS.panorama_lightfield,
        ),
    output:
        update(PATHS.panorama),
        receipt=receipt_of("{scene}/{rig}/panorama/render"),
    log:
        log_of("{scene}/{rig}/panorama/render"),
    benchmark:
        times_of("{scene}/{rig}/panorama/render")
    resources:
        **GPU,
        mem_mb=memory_of("render_panorama"),
        runtime=lambda wildcards, threads: cost_at(
            "render_panorama", wildcards
        ).most_minutes(threads),
    params:
        folder=PATHS.panorama_views,
        device=SETTINGS.device,
    message:
        "Rendering the panorama of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/render_shard.py"
        " --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --device {params.device} --threads {threads} --output {params.folder}"
        " --receipt {output.receipt} > {log} 2>&1"


rule figures:
    input:
        reads(
            "{scene}/{rig}/figures",
            "figures",
            views=of_build(BUILD.receipts),
            lightfield=PATHS.lightfield,
            panorama=of_dataset("panorama"),
        ),
    output:
        [
            report(
                f"{PATHS.folder}/report/{picture}.png",
                category="{scene}",
                subcategory="{rig}",
                caption=f"../captions/{picture}.rst",
            )
            for picture in PICTURES
        ],
        [update(f"{PATHS.folder}/report/{plot}.svg") for plot in PLOTS],
        receipt=receipt_of("{scene}/{rig}/figures"),
    log:
        log_of("{scene}/{rig}/figures"),
    benchmark:
        times_of("{scene}/{rig}/report/figures")
    localrule: True
    params:
        dataset=subpath(output[0], ancestor=2),
    message:
        "Drawing the pictures of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/report_figures.py"
        " --dataset {params.dataset} --settings {input.settings}"
        " --panorama {input.panorama} --output {params.dataset}/report"
        " --receipt {output.receipt} > {log} 2>&1"


rule page:
    input:
        reads(
            "{scene}/{rig}/page",
            "page",
            published=of_dataset("published"),
            views=of_dataset("all_receipts") if STORE else [],
            pictures=PATHS.pictures,
            validation=PATHS.validation,
            costs=PATHS.costs,
            inventory=of_dataset("blend_inventory"),
        ),
    output:
        page=update(PATHS.page),
        receipt=receipt_of("{scene}/{rig}/page"),
    log:
        log_of("{scene}/{rig}/page"),
    benchmark:
        times_of("{scene}/{rig}/report/page")
    localrule: True
    params:
        dataset=subpath(output.page, ancestor=2),
        inventory=optional("inventory"),
    message:
        "Making the page of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/report_html.py"
        " --dataset {params.dataset}"
        " --name {wildcards.scene}/{wildcards.rig} --settings {input.settings}"
        " {params.inventory} --output {output.page} --receipt {output.receipt} > {log} 2>&1"


# Runs of other scenes make it, too: its receipt has the pages of all datasets.
rule index:
    input:
        reads(
            "index",
            are_noted=True,
            pages=[dataset.paths.page for dataset in CHOSEN_DATASETS],
            corpora=BUILD.corpus_lists,
        ),
    output:
        page=update(f"{RESULTS}/index.html"),
        receipt=receipt_of("index"),
    log:
        log_of("index"),
    localrule: True
    params:
        results=subpath(output.page, parent=True),
    message:
        "Making the page of all datasets"
    shell:
        f"python {SCRIPTS}/report_index.py"
        " --results {params.results} --output {output.page}"
        " --receipt {output.receipt} > {log} 2>&1"
