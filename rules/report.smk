# Pictures and pages of datasets.
from lightfield.configuration.dataset_paths import PICTURES, PLOTS
from lightfield.workflow.arguments import optional
from lightfield.workflow.jobs import (
    FIGURES,
    INDEX,
    PAGE,
    PANORAMA_LIGHTFIELD,
    RENDER_PANORAMA,
    SEQUENCE_PAGE,
)


use rule lightfield as panorama_lightfield with:
    input:
        PLAN.reads(
            PANORAMA_LIGHTFIELD,
            inventory=RUN.of_dataset("rig_inventory"),
            model=RUN.of_dataset("model_record"),
            calibration=RUN.of_dataset("calibration"),
        ),
    output:
        lightfield=update(RUN.paths.panorama_lightfield),
        receipt=PLAN.receipt_of(PANORAMA_LIGHTFIELD),
    log:
        RUN.log_of(PANORAMA_LIGHTFIELD),
    benchmark:
        RUN.times_of(PANORAMA_LIGHTFIELD)
    localrule: True
    message:
        "Placing the panorama of {wildcards.scene}/{wildcards.rig}"


rule render_panorama:
    input:
        PLAN.reads(
            RENDER_PANORAMA,
            check=RUN.of_dataset("blend_check"),
            blend=RUN.of_dataset("blend"),
            inventory=RUN.of_dataset("inventory"),
            lightfield=RUN.paths.panorama_lightfield,
        ),
    output:
        update(RUN.paths.panorama),
        receipt=PLAN.receipt_of(RENDER_PANORAMA),
    log:
        RUN.log_of(RENDER_PANORAMA),
    benchmark:
        RUN.times_of(RENDER_PANORAMA)
    # Before the views. Otherwise it renders last, while other cores have nothing to do.
    priority: 1
    threads: REQUESTS.threads_of_panorama
    resources:
        **RUN.gpu,
        mem_mb=REQUESTS.memory_of(RENDER_PANORAMA),
        runtime=REQUESTS.minutes_of(RENDER_PANORAMA),
    params:
        folder=RUN.paths.panorama_views,
        device=RUN.settings.device,
    message:
        "Rendering the panorama of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/render_shard.py"
        " --blend {input.blend:q} --lightfield {input.lightfield}"
        " --inventory {input.inventory}"
        " --device {params.device} --threads {threads} --output {params.folder}"
        " --receipt {output.receipt} > {log} 2>&1"


rule figures:
    input:
        PLAN.reads(
            FIGURES,
            views=RUN.of_build(RUN.build.receipts),
            lightfield=RUN.paths.lightfield,
            panorama=RUN.of_dataset("panorama"),
        ),
    output:
        [
            report(
                f"{RUN.paths.folder}/report/{picture}.png",
                category="{scene}",
                subcategory="{rig}",
                caption=f"../captions/{picture}.rst",
            )
            for picture in PICTURES
        ],
        [update(f"{RUN.paths.folder}/report/{plot}.svg") for plot in PLOTS],
        receipt=PLAN.receipt_of(FIGURES),
    log:
        RUN.log_of(FIGURES),
    benchmark:
        RUN.times_of(FIGURES)
    localrule: True
    params:
        dataset=subpath(output[0], ancestor=2),
    message:
        "Drawing the pictures of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/report_figures.py"
        " --dataset {params.dataset} --settings {input.settings}"
        " --panorama {input.panorama} --output {params.dataset}/report"
        " --receipt {output.receipt} > {log} 2>&1"


rule page:
    input:
        PLAN.reads(
            PAGE,
            published=RUN.of_dataset("published"),
            views=PLAN.only_stored(RUN.of_dataset("all_receipts")),
            pictures=RUN.paths.pictures,
            validation=RUN.paths.validation,
            costs=RUN.paths.costs,
            inventory=RUN.of_dataset("blend_inventory"),
        ),
    output:
        page=update(RUN.paths.page),
        receipt=PLAN.receipt_of(PAGE),
    log:
        RUN.log_of(PAGE),
    benchmark:
        RUN.times_of(PAGE)
    localrule: True
    params:
        dataset=subpath(output.page, ancestor=2),
        inventory=optional("inventory"),
    message:
        "Making the page of {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/report_html.py"
        " --dataset {params.dataset}"
        " --name {wildcards.scene}/{wildcards.rig} --settings {input.settings}"
        " {params.inventory} --output {output.page} --receipt {output.receipt} > {log} 2>&1"


# A sequence has a page of its own, beside the pages of its frames.
rule sequence_page:
    input:
        PLAN.reads(
            SEQUENCE_PAGE,
            views=RUN.of_build(RUN.build.shown_frames),
        ),
    output:
        page=update(RUN.paths.sequence_page),
        receipt=PLAN.receipt_of(SEQUENCE_PAGE),
    log:
        RUN.log_of(SEQUENCE_PAGE),
    benchmark:
        RUN.times_of(SEQUENCE_PAGE)
    wildcard_constraints:
        rig="[A-Za-z0-9_.-]+",
    localrule: True
    params:
        rig=subpath(output.page, ancestor=2),
    message:
        "Making the page of the sequence {wildcards.scene}/{wildcards.rig}"
    shell:
        f"python {RUN.scripts}/report_sequence.py"
        " --rig {params.rig} --name {wildcards.scene}/{wildcards.rig}"
        " --settings {input.settings} --output {output.page} --receipt {output.receipt}"
        " > {log} 2>&1"


# Runs of other scenes make it, too: its receipt has the pages of all datasets.
rule index:
    input:
        PLAN.reads(
            INDEX,
            are_noted=True,
            pages=RUN.build.pages,
            corpora=RUN.build.corpus_lists,
        ),
    output:
        page=update(f"{RUN.results}/index.html"),
        receipt=PLAN.receipt_of(INDEX),
    log:
        RUN.log_of(INDEX),
    localrule: True
    params:
        results=subpath(output.page, parent=True),
    message:
        "Making the page of all datasets"
    shell:
        f"python {RUN.scripts}/report_index.py"
        " --results {params.results} --output {output.page}"
        " --receipt {output.receipt} > {log} 2>&1"
