# Files with which trainers open a dataset.
from lightfield.configuration.exports import SEQUENCE_EXPORTS


rule export_to_instant_ngp:
    input:
        reads(
            "{scene}/{rig}/{source}export_instant_ngp",
            "instant_ngp",
            views=of_build(BUILD.receipts),
            lightfield=PATHS.source_lightfield(),
            trained=of_build(BUILD.training_transforms),
        ),
    output:
        transforms=update(PATHS.transforms()),
        receipt=receipt_of("{scene}/{rig}/{source}export_instant_ngp"),
        bundle=bundle_of("{scene}/{rig}/{source}export_instant_ngp"),
    log:
        log_of("{scene}/{rig}/{source}export_instant_ngp"),
    benchmark:
        times_of("{scene}/{rig}/export/{source}instant_ngp")
    localrule: True
    params:
        views=of_build(BUILD.folder_of_views),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for instant-ngp"
    shell:
        f"python {SCRIPTS}/export_instant_ngp.py"
        " --settings {input.settings} --input-cfg {input.lightfield} --image-dir {params.views}"
        " --output {output.transforms} --receipt {output.receipt} > {log} 2>&1"


rule export:
    input:
        reads(
            "{scene}/{rig}/{source}export_{format}",
            "export",
            views=of_build(BUILD.exported_views),
            lightfield=PATHS.source_lightfield(),
            dataset=PATHS.lightfield,
        ),
    output:
        update(PATHS.export_list()),
        receipt=receipt_of("{scene}/{rig}/{source}export_{format}"),
        bundle=bundle_of("{scene}/{rig}/{source}export_{format}"),
    log:
        log_of("{scene}/{rig}/{source}export_{format}"),
    benchmark:
        times_of("{scene}/{rig}/export/{source}{format}")
    wildcard_constraints:
        format=rf"(?!(?:{one_of([* SEQUENCE_EXPORTS, 'instant_ngp'])})[/.])[a-z0-9_]+",
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        dataset=subpath(input.dataset, parent=True),
        folder=subpath(output[0], parent=True),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for {wildcards.format}"
    shell:
        f"python {SCRIPTS}/export.py"
        " {wildcards.format} --settings {input.settings} --dataset {params.dataset}"
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"


# The frames of a sequence lie in the rig's folder, beside the exports of all of them.
use rule export as export_sequence with:
    input:
        reads(
            "{scene}/{rig}/{source}sequence_{format}",
            "export_sequence",
            views=of_build(BUILD.exported_frames),
        ),
    output:
        update(PATHS.export_list()),
        receipt=receipt_of("{scene}/{rig}/{source}sequence_{format}"),
        bundle=bundle_of("{scene}/{rig}/{source}sequence_{format}"),
    log:
        log_of("{scene}/{rig}/{source}sequence_{format}"),
    wildcard_constraints:
        rig="[A-Za-z0-9_.-]+",
        format=one_of(SEQUENCE_EXPORTS),
    resources:
        mem_mb=4000,
        runtime=240,
    params:
        dataset=PATHS.folder,
    message:
        "Exporting the sequence {wildcards.scene}/{wildcards.rig} for {wildcards.format}"
