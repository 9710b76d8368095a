# A dataset as one archive, as SILVR publishes its own.


rule package:
    input:
        packed_sums,
    output:
        f"{RESULTS}/{{scene}}/{{scene}}_{{rig}}.tar",
    log:
        log_of("{scene}/{rig}/package"),
    conda:
        ENVIRONMENT
    params:
        folder=f"{RESULTS}/{{scene}}",
    message:
        "Packing {output}"
    shell:
        # The same files give the same archive, whoever packs them and when.
        # A report tells of one build, and is no part of the dataset.
        "tar --create --file {output} --directory {params.folder} --sort=name --mtime=@0"
        " --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX"
        " --exclude='{wildcards.rig}/report' --exclude='{wildcards.rig}/f*/report'"
        " --transform='s,^,{wildcards.scene}_,'"
        " {wildcards.rig} > {log} 2>&1"
