# Pictures and pages of datasets.
from lightfield.configuration.dataset_paths import PICTURES, PLOTS


use rule lightfield as panorama_lightfield with:
    input:
        settings=settings("panorama"),
        inventory=of_dataset("blend_inventory"),
        model=of_dataset("model_record"),
        calibration=of_dataset("calibration"),
    output:
        PATHS.panorama_lightfield,
    log:
        log_of("{scene}/{rig}/panorama/lightfield"),
    benchmark:
        times_of("{scene}/{rig}/panorama/lightfield")
    localrule: True
    message:
        "Placing the panorama of {wildcards.scene}/{wildcards.rig}"


rule render_panorama:
    input:
        check=of_dataset("blend_check"),
        blend=of_dataset("blend"),
        inventory=of_dataset("inventory"),
        lightfield=PATHS.panorama_lightfield,
    output:
        PATHS.panorama,
    log:
        log_of("{scene}/{rig}/panorama/render"),
    benchmark:
        times_of("{scene}/{rig}/panorama/render")
    resources:
        mem_mb=memory_of("render_panorama"),
        runtime=120,
        gpu=GPUS,
    params:
        folder=PATHS.panorama_views,
        device=SETTINGS.device,
    message:
        "Rendering the panorama of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {SCRIPTS}/render_shard.py"
        " --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --device {params.device} --threads {threads} --output {params.folder} > {log} 2>&1"


rule figures:
    input:
        settings=settings("figures"),
        records=of_build(BUILD.records),
        lightfield=PATHS.lightfield,
        panorama=of_dataset("panorama"),
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
        [f"{PATHS.folder}/report/{plot}.svg" for plot in PLOTS],
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
        f"{taking('input.records')}python {SCRIPTS}/report_figures.py"
        " --dataset {params.dataset} --settings {input.settings}"
        " --panorama {input.panorama} --output {params.dataset}/report > {log} 2>&1"


rule page:
    input:
        # Without a store the validation is enough, and a plan of many shards is shorter.
        records=of_dataset("all_records") if STORE else [],
        published=of_dataset("published"),
        pictures=PATHS.pictures,
        validation=PATHS.validation,
        costs=PATHS.costs,
        inventory=of_dataset("blend_inventory"),
        settings=settings("page"),
    output:
        PATHS.page,
    log:
        log_of("{scene}/{rig}/page"),
    benchmark:
        times_of("{scene}/{rig}/report/page")
    localrule: True
    params:
        dataset=subpath(output[0], ancestor=2),
        inventory=optional("inventory"),
    message:
        "Making the page of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"{taking('input')}python {SCRIPTS}/report_html.py"
        " --dataset {params.dataset}"
        " --name {wildcards.scene}/{wildcards.rig} --settings {input.settings}"
        " {params.inventory} --output {output} > {log} 2>&1"


rule index:
    input:
        settings=settings("index"),
        pages=[dataset.paths.page for dataset in CHOSEN],
        corpora=BUILD.corpora,
    output:
        f"{RESULTS}/index.html",
    log:
        log_of("index"),
    localrule: True
    params:
        results=subpath(output[0], parent=True),
    message:
        "Making the page of all datasets"
    shell:
        f"python {SCRIPTS}/report_index.py"
        " --results {params.results} --output {output} > {log} 2>&1"
