# A .blend: built by a scene builder, made of a model file, or brought by the user and checked.
from pathlib import Path


rule build_scene:
    input:
        reads(
            "{name}/build_scene",
            "build_scene",
            # With a store, each job's folder has a user's own builder, as it has the scene YAMLs.
            builder=lambda wildcards: (
                [] if STORE else asked(BUILD.scene, wildcards).builder_files
            ),
        ),
    output:
        # Snakemake copies a file before it is updated, and this one is large.
        blend=PATHS.built_blend,
        receipt=receipt_of("{name}/build_scene"),
    log:
        log_of("{name}/build_scene"),
    benchmark:
        times_of("{name}/build_scene")
    resources:
        mem_mb=8000,
        runtime=30,
    message:
        "Building the scene {wildcards.name}"
    shell:
        f"python {SCRIPTS}/build_scene.py"
        " --settings {input.settings} --output {output.blend} --receipt {output.receipt}"
        " > {log} 2>&1"


rule import_model:
    input:
        reads(
            "{name}/import_model",
            "import_model",
            model=lambda wildcards: local(asked(BUILD.scene, wildcards).source.model),
            light=light_of,
        ),
    output:
        blend=PATHS.model_blend,
        record=update(PATHS.model_record),
        receipt=receipt_of("{name}/import_model"),
    log:
        log_of("{name}/import_model"),
    benchmark:
        times_of("{name}/import_model")
    # With a store a user's files lie where Snakemake runs.
    localrule: bool(STORE)
    resources:
        mem_mb=8000,
        runtime=30,
    message:
        "Importing {input.model}"
    shell:
        f"python {SCRIPTS}/import_model.py"
        " --settings {input.settings} --output {output.blend} --record {output.record}"
        " --receipt {output.receipt} > {log} 2>&1"


rule check_blend:
    input:
        reads(
            "{name}/check_blend",
            "check_blend",
            blend=lambda wildcards: local(asked(BUILD.scene, wildcards).blend),
        ),
    output:
        check=update(PATHS.blend_check),
        receipt=receipt_of("{name}/check_blend"),
    log:
        log_of("{name}/check_blend"),
    benchmark:
        times_of("{name}/check_blend")
    localrule: True
    message:
        "Checking {input.blend}"
    shell:
        f"python {SCRIPTS}/check_blend.py"
        " --scene {wildcards.name} --blend {input.blend:q} --settings {input.settings}"
        " --output {output.check} --receipt {output.receipt} > {log} 2>&1"


rule inventory:
    input:
        reads(
            "{name}/inventory",
            "inventory",
            check=lambda wildcards: asked(BUILD.scene, wildcards).blend_check or [],
            blend=blend_of,
        ),
    output:
        inventory=update(PATHS.inventory),
        receipt=receipt_of("{name}/inventory"),
        bundle=bundle_of("{name}/inventory"),
    log:
        log_of("{name}/inventory"),
    benchmark:
        times_of("{name}/inventory")
    # With a store a user's files lie where Snakemake runs.
    localrule: bool(STORE) and any(d.source.blend or d.source.model for d in BUILD.scenes.values())
    resources:
        mem_mb=8000,
        runtime=30,
    message:
        "Listing what the scene {wildcards.name} contains"
    shell:
        f"python {SCRIPTS}/inventory.py"
        " --scene {wildcards.name} --blend {input.blend:q} --settings {input.settings}"
        " --output {output.inventory} --receipt {output.receipt} > {log} 2>&1"


# The users' .blend files, by path. Several scenes may share one.
BLENDS = {d.source.blend: name for name, d in BUILD.scenes.items() if d.source.blend}
# Only a file that is missing is downloaded. Snakemake removes a rule's output before it makes it
# again, as with --forceall, and a user's file may be the work of weeks.
MISSING = [
    blend
    for blend, name in BLENDS.items()
    if BUILD.scenes[name].source.url and not Path(blend).exists()
]


rule fetch_blend:
    output:
        local("{blend}"),
    log:
        log_of("fetch_blend/{blend}"),
    wildcard_constraints:
        blend=one_of(MISSING),
    # Run beside Snakemake, because a cluster's nodes may not reach the Internet.
    localrule: True
    params:
        name=lambda wildcards: BLENDS[wildcards.blend],
    message:
        "Downloading {output}"
    shell:
        f"python {SCRIPTS}/fetch_blend.py"
        " --scene {params.name} --output {output:q} > {log} 2>&1"


# If jobs share no folder, Snakemake fetches the copy in its storage for them.
rule store_blend:
    input:
        # The checked file may have changed, although it is older than the copy.
        check=lambda wildcards: BUILD.scenes[BLENDS[wildcards.blend]].blend_check,
        blend=local("{blend}"),
    output:
        "{blend}",
    log:
        log_of("store_blend/{blend}"),
    wildcard_constraints:
        blend=one_of(BLENDS if STORE else ()),
    localrule: True
    message:
        "Storing {input.blend}"
    shell:
        "cp {input.blend:q} {output:q} > {log} 2>&1"
