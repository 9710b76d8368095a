# Files with which trainers open a dataset.
from lightfield.configuration.exports import SEQUENCE_EXPORTS


rule export_to_instant_ngp:
    input:
        settings=settings("instant_ngp"),
        records=of_build(BUILD.records),
        lightfield=PATHS.source_lightfield(),
        trained=of_build(BUILD.training_transforms),
    output:
        PATHS.transforms(),
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
        f"{taking('input.records')}python {SCRIPTS}/export_instant_ngp.py"
        " --settings {input.settings} --input-cfg {input.lightfield} --image-dir {params.views}"
        " --output {output} > {log} 2>&1"


rule export:
    input:
        settings=settings("export"),
        views=of_build(BUILD.exported_views),
        lightfield=PATHS.source_lightfield(),
        dataset=PATHS.lightfield,
    output:
        PATHS.export_list(),
    log:
        log_of("{scene}/{rig}/{source}export_{format}"),
    benchmark:
        times_of("{scene}/{rig}/export/{source}{format}")
    wildcard_constraints:
        format=rf"(?!(?:{one_of(SEQUENCE_EXPORTS)})/)[a-z0-9_]+",
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        dataset=subpath(input.dataset, parent=True),
        folder=subpath(output[0], parent=True),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for {wildcards.format}"
    shell:
        f"{taking('input.views')}python {SCRIPTS}/export.py"
        " {wildcards.format} --settings {input.settings} --dataset {params.dataset}"
        " --output {params.folder} > {log} 2>&1"


# The frames of a sequence lie in the rig's folder, beside the exports of all of them.
use rule export as export_sequence with:
    input:
        settings=settings("export_sequence"),
        views=of_build(BUILD.exported_frames),
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
