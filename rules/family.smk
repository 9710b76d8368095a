# Families of scenes. One job builds a batch of members, with all stages of each.
from lightfield.configuration.corpus import CORPUS_FILES


rule build_members:
    input:
        PLAN.reads("{family}/batches/{batch}", "batch"),
    output:
        receipt=PLAN.receipt_of("{family}/batches/{batch}"),
        bundle=PLAN.bundle_of("{family}/batches/{batch}"),
    log:
        RUN.log_of("{family}/batches/{batch}"),
    benchmark:
        RUN.times_of("{family}/batches/{batch}")
    # With a store, model files lie where Snakemake runs.
    localrule: PLAN.is_stored and any(family.models for family in RUN.build.families.values())
    # One core, or more if there are fewer batches than cores.
    threads: REQUESTS.threads_of_batch
    resources:
        **RUN.gpu,
        mem_mb=8000,
        runtime=1440,
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
        PLAN.reads(
            "{family}/corpus", "corpus", batches=RUN.of_build(RUN.build.batch_receipts)
        ),
    output:
        [update(f"{RUN.results}/{{family}}/{name}") for name in CORPUS_FILES],
        receipt=PLAN.receipt_of("{family}/corpus"),
        bundle=PLAN.bundle_of("{family}/corpus"),
    log:
        RUN.log_of("{family}/corpus"),
    benchmark:
        RUN.times_of("{family}/corpus")
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
            "{family}/members",
            "members",
            corpus=f"{RUN.results}/{{family}}/corpus.json",
        ),
    output:
        members=update(f"{RUN.work}/{{family}}/members.json"),
        receipt=PLAN.receipt_of("{family}/members"),
    log:
        RUN.log_of("{family}/members"),
    localrule: True
    params:
        failed=f"{RUN.results}/{{family}}/failed.txt",
    message:
        "Counting the members of {wildcards.family}"
    shell:
        f"python {RUN.scripts}/count_members.py"
        " --settings {input.settings} --corpus {input.corpus} --failed {params.failed}"
        " --output {output.members} --receipt {output.receipt} > {log} 2>&1"
