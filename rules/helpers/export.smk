# What the rules of export.smk ask of the configuration.


def export_of(wildcards):
    """Return what an export's job is asked for."""
    dataset, name = dataset_of(wildcards), wildcards.format
    folder = f"{dataset.folder}/exports"
    return one_of(dataset.exports.selected, name, folder, "export of it")


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


def folder_of_views(wildcards):
    """Return the folder of the views that an export reads."""
    source = wildcards.source.rstrip("/")
    return f"{dataset_of(wildcards).folder}/{source or 'exr'}"


def export_settings(wildcards):
    """Return the settings file of an export."""
    dataset = dataset_of(wildcards)
    source = wildcards.source.rstrip("/") or VIEWS
    reprojection = reprojection_of(wildcards)
    if "format" in wildcards.keys():
        name = wildcards.format
        options = export_of(wildcards)
        roles = {"tested_by": {d.rig_name: d.folder for d in tested_by(wildcards)}}
    else:
        name = "instant_ngp"
        # A transforms.json can be asked for where the scene YAML has no such export.
        options = dataset.exports.instant_ngp or InstantNgp(sources=[source])
        trained = trained_by(wildcards)
        roles = {"trained_by": trained} if trained else {}
    settings = export_settings_of(name)(
        options=options.model_copy(update={"sources": [source]}),
        suffix=reprojection.suffix if reprojection else ".exr",
        **roles,
    )
    return dataset_settings(dataset, f"exports/{source}/{name}", settings.as_json())
