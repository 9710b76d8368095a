# Files with which trainers open a dataset.
from lightfield.configuration.exports import SEQUENCE_EXPORTS
from lightfield.workflow.jobs import EXPORT, EXPORT_INSTANT_NGP, EXPORT_SEQUENCE
from lightfield.workflow.run import one_of


rule export_to_instant_ngp:
    input:
        PLAN.reads(
            EXPORT_INSTANT_NGP,
            views=RUN.of_build(RUN.build.receipts),
            lightfield=RUN.paths.source_lightfield(),
            trained=RUN.of_build(RUN.build.training_transforms),
        ),
    output:
        transforms=update(RUN.paths.transforms()),
        receipt=PLAN.receipt_of(EXPORT_INSTANT_NGP),
        bundle=PLAN.bundle_of(EXPORT_INSTANT_NGP),
    log:
        RUN.log_of(EXPORT_INSTANT_NGP),
    benchmark:
        RUN.times_of(EXPORT_INSTANT_NGP)
    localrule: True
    params:
        views=RUN.of_build(RUN.build.folder_of_views),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for instant-ngp"
    shell:
        f"python {RUN.scripts}/export_instant_ngp.py"
        " --settings {input.settings} --input-cfg {input.lightfield} --image-dir {params.views}"
        " --output {output.transforms} --receipt {output.receipt} > {log} 2>&1"


rule export:
    input:
        PLAN.reads(
            EXPORT,
            views=RUN.of_build(RUN.build.exported_views),
            lightfield=RUN.paths.source_lightfield(),
            dataset=RUN.paths.lightfield,
        ),
    output:
        update(RUN.paths.export_list()),
        receipt=PLAN.receipt_of(EXPORT),
        bundle=PLAN.bundle_of(EXPORT),
    log:
        RUN.log_of(EXPORT),
    benchmark:
        RUN.times_of(EXPORT)
    wildcard_constraints:
        format=rf"(?!(?:{one_of([* SEQUENCE_EXPORTS, 'instant_ngp'])})[/.])[a-z0-9_]+",
    resources:
        mem_mb=4000,
        runtime=RUN.at_most(120),
    params:
        dataset=subpath(input.dataset, parent=True),
        folder=subpath(output[0], parent=True),
    message:
        "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for {wildcards.format}"
    shell:
        f"python {RUN.scripts}/export.py"
        " {wildcards.format} --settings {input.settings} --dataset {params.dataset}"
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"


# The frames of a sequence lie in the rig's folder, beside the exports of all of them.
use rule export as export_sequence with:
    input:
        PLAN.reads(
            EXPORT_SEQUENCE,
            views=RUN.of_build(RUN.build.exported_frames),
        ),
    output:
        update(RUN.paths.export_list()),
        receipt=PLAN.receipt_of(EXPORT_SEQUENCE),
        bundle=PLAN.bundle_of(EXPORT_SEQUENCE),
    log:
        RUN.log_of(EXPORT_SEQUENCE),
    wildcard_constraints:
        rig="[A-Za-z0-9_.-]+",
        format=one_of(SEQUENCE_EXPORTS),
    resources:
        mem_mb=4000,
        runtime=RUN.at_most(240),
    params:
        dataset=RUN.paths.folder,
    message:
        "Exporting the sequence {wildcards.scene}/{wildcards.rig} for {wildcards.format}"
