# What the rules of export.smk ask of the configuration.


def export_of(wildcards):
    """Return what an export's job is asked for."""
    dataset, name = dataset_of(wildcards), wildcards.format
    folder = f"{dataset.folder}/exports"
    return one_of(dataset.exports.wanted, name, folder, "export of it")


def tested_by(wildcards):
    """Return the datasets whose views go into an export of this one, to test with."""
    dataset = dataset_of(wildcards)
    rigs = dataset.tested_by if export_of(wildcards).is_for_training else ()
    return [DATASETS[f"{dataset.scene_folder}/{rig}"] for rig in rigs]


def exported_views(wildcards):
    """Return what an export reads: the views of its dataset and of those that test it.

    Points are lifted from the depth of the rendered views, whatever the source.
    """
    dataset = dataset_of(wildcards)
    files = [*dataset.records("render"), *records(wildcards)]
    for other in tested_by(wildcards):
        files += [*other.records("render"), *other.records(stage_of(wildcards))]
        files += [
            f"{other.folder}/{name}lightfield.json" for name in ("", wildcards.source)
        ]
    return list(dict.fromkeys(files))


def trained_by(wildcards):
    """Return the transforms.json, if any, of what is trained on and tested by this dataset."""
    dataset = dataset_of(wildcards)
    if dataset.trained_by is None:
        return []
    folder = f"{RESULTS}/{dataset.scene_folder}/{dataset.trained_by}"
    return f"{folder}/{wildcards.source}transforms.json"


def instant_ngp_words(wildcards, input):
    """Return the words that say to scripts/export_instant_ngp.py from what it writes, and what."""
    dataset, reprojection = dataset_of(wildcards), reprojection_of(wildcards)
    words = ["--image-suffix", reprojection.suffix if reprojection else ".exr"]
    if not reprojection:
        words += ["--image-dir", f"{dataset.folder}/exr"]
    if dataset.exports.instant_ngp:
        folder = Path(dataset.folder, wildcards.source)
        words += dataset.exports.instant_ngp.words(str(folder))
    if input.trained:
        words += ["--placed-as", str(input.trained)]
    return shlex.join(words)


def export_words(wildcards):
    """Return the words that say to scripts/export.py from what it exports, and how."""
    dataset = dataset_of(wildcards)
    reprojection = reprojection_of(wildcards)
    suffix = reprojection.suffix if reprojection else ".exr"
    options = export_of(wildcards).model_dump_json(
        exclude_unset=True, exclude={"sources"}
    )
    name = wildcards.source.rstrip("/") or VIEWS
    words = ["--source", name, "--suffix", suffix, "--options", options]
    for other in tested_by(wildcards):
        words += ["--tested-by", other.rig_name, other.folder]
    return shlex.join(words)


def export_settings(wildcards):
    """Return the settings file of an export: its options, and the rigs that test it."""
    dataset = dataset_of(wildcards)
    mark_stale_files(dataset.name)
    name = wildcards.get("format", "instant_ngp")
    source = wildcards.source.rstrip("/") or VIEWS
    reprojection = reprojection_of(wildcards)
    # A transforms.json can be asked for where the scene YAML has no such export.
    wanted = dataset.exports.wanted.get(name)
    testing = tested_by(wildcards) if "format" in wildcards.keys() else []
    content = {
        "options": wanted.recorded if wanted else {},
        "suffix": reprojection.suffix if reprojection else ".exr",
        "trained_by": dataset.trained_by,
        "tested_by": [other.rig_folder for other in testing],
    }
    return settings_file(
        f"{dataset.work}/settings/exports/{source}/{name}.json", content
    )
