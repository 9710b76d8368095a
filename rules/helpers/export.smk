# Functions for the rules of export.smk.


def export_of(wildcards):
    """Return the options of an export."""
    dataset = dataset_of(wildcards)
    folder = f"{dataset.folder}/exports"
    return one_of(dataset.exports.selected, wildcards.format, folder, "export of it")


def tested_by(wildcards):
    """Return the datasets whose views go into an export of this one, to test with."""
    dataset = dataset_of(wildcards)
    rigs = dataset.tested_by if export_of(wildcards).is_for_training else ()
    return [DATASETS[f"{dataset.scene_folder}/{rig}"] for rig in rigs]


def exported_views(wildcards):
    """Return the inputs of an export: the views of its dataset, and of those that test it.

    Points follow from the depth of the rendered views, for any source.
    """
    dataset = dataset_of(wildcards)
    files = [*dataset.records("render"), *records(wildcards)]
    for test_dataset in tested_by(wildcards):
        files += test_dataset.records("render")
        files += test_dataset.records(stage_of(wildcards))
        for source in ("", wildcards.source):
            files.append(f"{test_dataset.folder}/{source}lightfield.json")
    return list(dict.fromkeys(files))


def trained_by(wildcards):
    """Return the transforms.json of the training views that this dataset tests, if any."""
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
        # A user may name a transforms.json that the scene YAML does not export.
        options = dataset.exports.instant_ngp or InstantNgp(sources=[source])
        trained = trained_by(wildcards)
        roles = {"trained_by": trained} if trained else {}
    settings = export_settings_of(name)(
        options=options.model_copy(update={"sources": [source]}),
        suffix=reprojection.suffix if reprojection else ".exr",
        **roles,
    )
    return dataset_settings(dataset, f"exports/{source}/{name}", settings.as_json())
