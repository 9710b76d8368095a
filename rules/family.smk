# Families of scenes. One job builds a batch of members, with all stages of each.
from lightfield.configuration.corpus import CORPUS_FILES


rule build_members:
    input:
        reads("{family}/batches/{batch}", "batch"),
    output:
        receipt=receipt_of("{family}/batches/{batch}"),
        bundle=bundle_of("{family}/batches/{batch}"),
    log:
        log_of("{family}/batches/{batch}"),
    benchmark:
        times_of("{family}/batches/{batch}")
    # With a store, model files lie where Snakemake runs.
    localrule: bool(STORE) and any(family.models for family in BUILD.families.values())
    # One core, or more if there are fewer batches than cores.
    threads: lambda wildcards: max(1, ALL_CORES // BUILD.batch_count)
    resources:
        **GPU,
        mem_mb=8000,
        runtime=1440,
    params:
        device=SETTINGS.device,
    message:
        "Building the members {wildcards.batch} of {wildcards.family}"
    shell:
        f"python {SCRIPTS}/build_members.py"
        " --settings {input.settings} --device {params.device} --threads {threads}"
        " --receipt {output.receipt} > {log} 2>&1"


rule corpus:
    input:
        reads("{family}/corpus", "corpus", batches=of_build(BUILD.batch_receipts)),
    output:
        [update(f"{RESULTS}/{{family}}/{name}") for name in CORPUS_FILES],
        receipt=receipt_of("{family}/corpus"),
        bundle=bundle_of("{family}/corpus"),
    log:
        log_of("{family}/corpus"),
    benchmark:
        times_of("{family}/corpus")
    localrule: True
    params:
        folder=f"{RESULTS}/{{family}}",
        cache=f"{WORK}/{{family}}/looks.json",
    message:
        "Collecting the members of {wildcards.family}"
    shell:
        f"python {SCRIPTS}/corpus.py"
        " {params.folder} --settings {input.settings} --cache {params.cache}"
        " --receipt {output.receipt} > {log} 2>&1"


# It fails if a member has failed, after all others are built and collected.
rule count_members:
    input:
        reads(
            "{family}/members",
            "members",
            corpus=f"{RESULTS}/{{family}}/corpus.json",
        ),
    output:
        members=update(f"{WORK}/{{family}}/members.json"),
        receipt=receipt_of("{family}/members"),
    log:
        log_of("{family}/members"),
    localrule: True
    params:
        failed=f"{RESULTS}/{{family}}/failed.txt",
    message:
        "Counting the members of {wildcards.family}"
    shell:
        f"python {SCRIPTS}/count_members.py"
        " --settings {input.settings} --corpus {input.corpus} --failed {params.failed}"
        " --output {output.members} --receipt {output.receipt} > {log} 2>&1"
