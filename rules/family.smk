# Families of scenes. One job builds a batch of members, with all stages of each.
from lightfield.configuration.corpus import CORPUS_FILES


wildcard_constraints:
    family=one_of(BUILD.family_names),
    batch=r"(seeds|models)_\d+_(of_)?\d+",


rule build_members:
    input:
        settings=settings("batch"),
    output:
        f"{WORK}/{{family}}/batches/{{batch}}.json",
    log:
        log_of("{family}/batches/{batch}"),
    benchmark:
        times_of("{family}/batches/{batch}")
    # With a store, model files lie where Snakemake runs.
    localrule: bool(STORE) and any(family.models for family in BUILD.families.values())
    # One core, or more if there are fewer batches than cores.
    threads: lambda wildcards: max(1, ALL_CORES // BUILD.batch_count)
    resources:
        mem_mb=8000,
        runtime=1440,
        gpu=GPUS,
    params:
        device=SETTINGS.device,
    message:
        "Building the members {wildcards.batch} of {wildcards.family}"
    shell:
        f"python {SCRIPTS}/build_members.py"
        " --settings {input.settings} --device {params.device} --threads {threads}"
        " --record {output} > {log} 2>&1"


rule corpus:
    input:
        settings=settings("corpus"),
        records=of_build(BUILD.batch_records),
    output:
        [f"{RESULTS}/{{family}}/{name}" for name in CORPUS_FILES],
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
        " {params.folder} --settings {input.settings} --cache {params.cache} > {log} 2>&1"


# It fails if a member has failed, after all others are built and collected.
rule count_members:
    input:
        settings=settings("members"),
        records=of_build(BUILD.batch_records),
        corpus=f"{RESULTS}/{{family}}/corpus.json",
    output:
        f"{WORK}/{{family}}/members.json",
    log:
        log_of("{family}/members"),
    localrule: True
    params:
        failed=f"{RESULTS}/{{family}}/failed.txt",
    message:
        "Counting the members of {wildcards.family}"
    shell:
        f"python {SCRIPTS}/count_members.py"
        " --settings {input.settings} --failed {params.failed} --output {output} > {log} 2>&1"
