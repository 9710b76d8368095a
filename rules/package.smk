# A dataset as archives with a card, as SILVR publishes its own.
from lightfield.workflow.jobs import PACK, PUBLISH


rule pack:
    input:
        PLAN.reads(
            PACK,
            sums=RUN.of_build(RUN.build.packed_sums),
            page=RUN.of_build(RUN.build.packed_page),
            files=PLAN.only_stored(RUN.of_build(RUN.build.packed_lists)),
        ),
    output:
        archive=RUN.paths.package,
        card=update(RUN.paths.card),
        receipt=PLAN.receipt_of(PACK),
        bundle=PLAN.bundle_of(PACK),
    log:
        RUN.log_of(PACK),
    params:
        folder=RUN.paths.folder,
    message:
        "Packing {output.archive}"
    shell:
        f"python {RUN.scripts}/package.py"
        " --settings {input.settings} --folder {params.folder} --output {output.archive}"
        " --receipt {output.receipt} > {log} 2>&1"


rule publish:
    input:
        PLAN.reads(
            PUBLISH,
            sums=RUN.of_build(RUN.build.packed_sums),
            files=PLAN.only_stored(RUN.of_build(RUN.build.packed_lists)),
        ),
    output:
        [update(document) for document in RUN.paths.documents],
        receipt=PLAN.receipt_of(PUBLISH),
        bundle=PLAN.bundle_of(PUBLISH),
    log:
        RUN.log_of(PUBLISH),
    params:
        folder=RUN.paths.folder,
        output=subpath(output[0], parent=True),
    message:
        "Publishing {wildcards.scene}/{wildcards.rig} in {params.output}"
    shell:
        f"python {RUN.scripts}/publish.py"
        " --settings {input.settings} --folder {params.folder} --output {params.output}"
        " --receipt {output.receipt} > {log} 2>&1"
