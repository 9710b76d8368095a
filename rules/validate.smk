# Checksums of all that is published, and what the pixels must satisfy.


rule validate:
    input:
        records=lambda wildcards: all_records(dataset_of(wildcards)),
        published=lambda wildcards: published(dataset_of(wildcards)),
        cameras=f"{MADE}/cameras.json",
    output:
        validation=f"{DATASET}/validation.json",
        sums=f"{DATASET}/sha256sums.txt",
    log:
        f"{WORK}/logs/{{scene}}/{{rig}}/validate.log",
    benchmark:
        f"{WORK}/benchmarks/{{scene}}/{{rig}}/validate.tsv"
    conda:
        ENVIRONMENT
    threads: 2
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        dataset=DATASET,
        reprojections=reprojection_words,
    message:
        "Validating {wildcards.scene}/{wildcards.rig}"
    shell:
        "python scripts/validate.py --dataset {params.dataset} {params.reprojections}"
        " --records {input.records} --clearance {input.cameras} --processes {threads}"
        " --output {output.validation} --sums {output.sums} 2>&1 | tee {log}"
