# The optical flow from each view to its neighbour.


rule flow:
    input:
        # A neighbour may belong to another shard.
        reads(
            "{scene}/{rig}/flow/{first}-{end}",
            "flow",
            views=of_build(BUILD.receipts),
            lightfield=PATHS.lightfield,
        ),
    output:
        receipt=receipt_of("{scene}/{rig}/flow/{first}-{end}"),
        bundle=bundle_of("{scene}/{rig}/flow/{first}-{end}"),
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
        f"python {SCRIPTS}/flow.py"
        " --settings {input.settings} --lightfield {input.lightfield} --views {wildcards.first}:{wildcards.end}"
        " --output {params.folder} --receipt {output.receipt} > {log} 2>&1"
