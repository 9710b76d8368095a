# Files with which trainers open a dataset.
from lightfield.exporters import BESIDE_VIEWS, SEQUENCE_EXPORTS
from lightfield.workflow.jobs import EXPORT_RULES, EXPORT_SEQUENCE
from lightfield.workflow.run import one_of

# The formats that have rules of their own.
OTHER_EXPORTS = one_of((*SEQUENCE_EXPORTS, *BESIDE_VIEWS))

# The list of an export lies in a folder named after the format, or beside the views. All paths of a
# rule must have the same wildcards, so each format beside the views has a rule of its own.
for NAME, EXPORTED in EXPORT_RULES.items():

    rule:
        name:
            NAME
        input:
            PLAN.reads(
                EXPORTED,
                views=RUN.of_build(RUN.build.exported_views),
                lightfield=RUN.paths.source_lightfield(),
                dataset=RUN.paths.lightfield,
                training=RUN.of_build(RUN.build.training_lists),
            ),
        output:
            update(EXPORTED.file(RUN.paths)),
            receipt=PLAN.receipt_of(EXPORTED),
            bundle=PLAN.bundle_of(EXPORTED),
        log:
            RUN.log_of(EXPORTED),
        benchmark:
            RUN.times_of(EXPORTED)
        wildcard_constraints:
            format=rf"(?!(?:{OTHER_EXPORTS})[/.])[a-z0-9_]+",
        resources:
            mem_mb=4000,
            runtime=RUN.at_most(120),
        params:
            format=EXPORTED.pattern("format"),
            dataset=subpath(input.dataset, parent=True),
            folder=subpath(output[0], parent=True),
        message:
            "Exporting {wildcards.scene}/{wildcards.rig}/{wildcards.source} for {params.format}"
        shell:
            f"python {RUN.scripts}/export.py"
            " {params.format} --settings {input.settings} --dataset {params.dataset}"
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
