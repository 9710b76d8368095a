# Families of scenes. One job builds a batch of members, with the stages of all their jobs.
from lightfield.configuration.corpus import CORPUS_FILES
from lightfield.workflow.jobs import BUILD_MEMBERS, CORPUS, COUNT_MEMBERS


rule build_members:
    input:
        PLAN.reads(BUILD_MEMBERS),
    output:
        receipt=PLAN.receipt_of(BUILD_MEMBERS),
        bundle=PLAN.bundle_of(BUILD_MEMBERS),
    log:
        RUN.log_of(BUILD_MEMBERS),
    benchmark:
        RUN.times_of(BUILD_MEMBERS)
    # With a store, model files lie where Snakemake runs.
    localrule: PLAN.is_stored and any(family.models for family in RUN.build.families.values())
    # One core, or more if there are fewer batches than cores.
    threads: REQUESTS.threads_of_batch
    resources:
        **RUN.gpu,
        mem_mb=8000,
        runtime=RUN.at_most(1440),
    params:
        device=RUN.settings.device,
    message:
        "Building the members {wildcards.batch} of {wildcards.family}"
    shell:
        f"python {RUN.scripts}/build_members.py"
        " --settings {input.settings} --device {params.device} --threads {threads}"
        " --receipt {output.receipt} > {log} 2>&1"


rule corpus:
    input:
        PLAN.reads(CORPUS, batches=RUN.of_build(PLAN.batch_receipts)),
    output:
        [update(f"{RUN.results}/{{family}}/{name}") for name in CORPUS_FILES],
        receipt=PLAN.receipt_of(CORPUS),
        bundle=PLAN.bundle_of(CORPUS),
    log:
        RUN.log_of(CORPUS),
    benchmark:
        RUN.times_of(CORPUS)
    localrule: True
    params:
        folder=f"{RUN.results}/{{family}}",
        cache=f"{RUN.work}/{{family}}/looks.json",
    message:
        "Collecting the members of {wildcards.family}"
    shell:
        f"python {RUN.scripts}/corpus.py"
        " {params.folder} --settings {input.settings} --cache {params.cache}"
        " --receipt {output.receipt} > {log} 2>&1"


# It fails if a member has failed, after all others are built and collected.
rule count_members:
    input:
        PLAN.reads(
            COUNT_MEMBERS,
            corpus=f"{RUN.results}/{{family}}/corpus.json",
        ),
    output:
        members=update(f"{RUN.work}/{{family}}/members.json"),
        receipt=PLAN.receipt_of(COUNT_MEMBERS),
    log:
        RUN.log_of(COUNT_MEMBERS),
    localrule: True
    params:
        failed=f"{RUN.results}/{{family}}/failed.txt",
    message:
        "Counting the members of {wildcards.family}"
    shell:
        f"python {RUN.scripts}/count_members.py"
        " --settings {input.settings} --corpus {input.corpus} --failed {params.failed}"
        " --output {output.members} --receipt {output.receipt} > {log} 2>&1"


# It has no output. The corpora come first: then no list of checksums has what is removed.
rule prune:
    input:
        RUN.build.corpora,
    log:
        RUN.log_of("prune"),
    localrule: True
    params:
        prune=PLAN.prune_command,
    message:
        "Removing what the chosen families no longer have"
    shell:
        "{params.prune} 2>&1 | tee {log}"
