# A .blend: built by a scene builder, made of a model file, or brought by the user and checked.
from lightfield.workflow.jobs import BUILD_SCENE, CHECK_BLEND, IMPORT_MODEL, INVENTORY
from lightfield.workflow.run import one_of


rule build_scene:
    input:
        PLAN.reads(
            BUILD_SCENE,
            # With a store, each job's folder has a user's own builder, as it has the scene YAMLs.
            builder=PLAN.only_shared(RUN.builder_of),
        ),
    output:
        # Snakemake copies a file before it is updated, and this one is large.
        blend=RUN.paths.built_blend,
        receipt=PLAN.receipt_of(BUILD_SCENE),
    log:
        RUN.log_of(BUILD_SCENE),
    benchmark:
        RUN.times_of(BUILD_SCENE)
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(30),
    message:
        "Building the scene {wildcards.name}"
    shell:
        f"python {RUN.scripts}/build_scene.py"
        " --settings {input.settings} --output {output.blend} --receipt {output.receipt}"
        " > {log} 2>&1"


rule import_model:
    input:
        PLAN.reads(
            IMPORT_MODEL,
            model=RUN.model_of,
            light=RUN.light_of,
        ),
    output:
        blend=RUN.paths.model_blend,
        record=update(RUN.paths.model_record),
        receipt=PLAN.receipt_of(IMPORT_MODEL),
    log:
        RUN.log_of(IMPORT_MODEL),
    benchmark:
        RUN.times_of(IMPORT_MODEL)
    # With a store a user's files lie where Snakemake runs.
    localrule: PLAN.is_stored
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(30),
    message:
        "Importing {input.model}"
    shell:
        f"python {RUN.scripts}/import_model.py"
        " --settings {input.settings} --output {output.blend} --record {output.record}"
        " --receipt {output.receipt} > {log} 2>&1"


rule check_blend:
    input:
        PLAN.reads(
            CHECK_BLEND,
            blend=RUN.checked_blend_of,
        ),
    output:
        check=update(RUN.paths.blend_check),
        receipt=PLAN.receipt_of(CHECK_BLEND),
    log:
        RUN.log_of(CHECK_BLEND),
    benchmark:
        RUN.times_of(CHECK_BLEND)
    localrule: True
    message:
        "Checking {input.blend}"
    shell:
        f"python {RUN.scripts}/check_blend.py"
        " --scene {wildcards.name} --blend {input.blend:q} --settings {input.settings}"
        " --output {output.check} --receipt {output.receipt} > {log} 2>&1"


rule inventory:
    input:
        PLAN.reads(
            INVENTORY,
            check=RUN.blend_check_of,
            blend=RUN.blend_of,
        ),
    output:
        inventory=update(RUN.paths.inventory),
        receipt=PLAN.receipt_of(INVENTORY),
        bundle=PLAN.bundle_of(INVENTORY),
    log:
        RUN.log_of(INVENTORY),
    benchmark:
        RUN.times_of(INVENTORY)
    # With a store a user's files lie where Snakemake runs.
    localrule:
        PLAN.is_stored
        and any(d.source.blend or d.source.model for d in RUN.build.scenes.values())
    resources:
        mem_mb=8000,
        runtime=RUN.at_most(30),
    message:
        "Listing what the scene {wildcards.name} contains"
    shell:
        f"python {RUN.scripts}/inventory.py"
        " --scene {wildcards.name} --blend {input.blend:q} --settings {input.settings}"
        " --output {output.inventory} --receipt {output.receipt} > {log} 2>&1"


# Only a file that is missing is downloaded.
rule fetch_blend:
    output:
        local("{blend}"),
    log:
        RUN.log_of("fetch_blend/{blend}"),
    wildcard_constraints:
        blend=one_of(RUN.missing_blends),
    # Run beside Snakemake, because a cluster's nodes may not reach the Internet.
    localrule: True
    params:
        name=lambda wildcards: RUN.blends[wildcards.blend],
    message:
        "Downloading {output}"
    shell:
        f"python {RUN.scripts}/fetch_blend.py"
        " --scene {params.name} --output {output:q} > {log} 2>&1"


# If jobs share no folder, Snakemake fetches the copy in its storage for them.
rule store_blend:
    input:
        # The checked file may have changed, although it is older than the copy.
        check=lambda wildcards: RUN.build.scenes[
            RUN.blends[wildcards.blend]
        ].blend_check,
        blend=local("{blend}"),
    output:
        "{blend}",
    log:
        RUN.log_of("store_blend/{blend}"),
    wildcard_constraints:
        blend=one_of(PLAN.only_stored(RUN.blends)),
    localrule: True
    message:
        "Storing {input.blend}"
    shell:
        "cp {input.blend:q} {output:q} > {log} 2>&1"
