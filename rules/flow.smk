# The optical flow from each view to its neighbour.


rule flow:
    input:
        # A neighbour may belong to another shard.
        records=of_build(BUILD.records),
        lightfield=PATHS.lightfield,
    output:
        PATHS.record("flow"),
    log:
        log_of("{scene}/{rig}/flow/{first}-{end}"),
    benchmark:
        times_of("{scene}/{rig}/flow/{first}-{end}")
    resources:
        mem_mb=2000,
    params:
        folder=PATHS.reprojected("flow"),
    message:
        "Computing the flow of views {wildcards.first} to {wildcards.end} of"
        " {wildcards.scene}/{wildcards.rig}"
    shell:
        f"{taking('input.records')}python {SCRIPTS}/flow.py"
        " --lightfield {input.lightfield} --views {wildcards.first}:{wildcards.end}"
        " --output {params.folder} --record {output} > {log} 2>&1"
