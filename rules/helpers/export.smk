# Functions for the rules of export.smk.


def export_of(wildcards):
    """Return the options of an export."""
    dataset = dataset_of(wildcards)
    folder = f"{dataset.paths.folder}/exports"
    return one_of(dataset.exports.selected, wildcards.format, folder, "export of it")


def tested_by(wildcards):
    """Return the datasets whose views go into an export of this one, to test with."""
    return testing(dataset_of(wildcards), export_of(wildcards))


def testing(dataset, export):
    """Return the datasets whose views go into an ``export`` of a dataset, to test with."""
    rigs = dataset.tested_by if export.is_for_training else ()
    return [DATASETS[f"{dataset.scene_folder}/{rig}"] for rig in rigs]


def exported_views(wildcards):
    """Return the inputs of an export: the views of its dataset, and of those that test it.

    Points follow from the depth of the rendered views, for any source.
    """
    dataset = dataset_of(wildcards)
    files = [*dataset.records("render"), *records(wildcards)]
    for test_dataset in tested_by(wildcards):
        files += views_of_source(test_dataset, wildcards)
    return list(dict.fromkeys(files))


def views_of_source(dataset, wildcards):
    """Return the records and light fields of a dataset's views, and of those of the source."""
    files = [*dataset.records("render"), *dataset.records(stage_of(wildcards))]
    for source in ("", wildcards.source):
        files.append(dataset.paths.source_lightfield(source))
    return files


def frames_of(wildcards):
    """Return the datasets of a rig's sequence, in the order of time.

    Ends the run if there is none, and if it has no export of the job's format.
    """
    name = f"{wildcards.scene}/{wildcards.rig}"
    frames = [
        dataset
        for dataset in DATASETS.values()
        if f"{dataset.scene_folder}/{dataset.rig_name}" == name and dataset.rig.sequence
    ]
    format = wildcards.get("format")
    if not frames or (format and format not in frames[0].exports.selected):
        sys.exit(
            f"error: {RESULTS}/{name}/exports/{format}: the scene YAML asks for no such "
            "export of a sequence"
        )
    return frames


def exported_frames(wildcards):
    """Return the inputs of an export of a sequence: the views of all frames."""
    files = []
    for dataset in frames_of(wildcards):
        export = dataset.exports.selected[wildcards.format]
        for each in (dataset, *testing(dataset, export)):
            files += views_of_source(each, wildcards)
    return list(dict.fromkeys(files))


def sequence_export_settings(wildcards):
    """Return the settings file of an export of a sequence."""
    frames = frames_of(wildcards)
    first = frames[0]
    source = wildcards.source.rstrip("/") or VIEWS
    options = first.exports.selected[wildcards.format]
    settings = export_settings_of(wildcards.format)(
        options=options.model_copy(update={"sources": [source]}),
        suffix=first.reprojections[source].suffix if source != VIEWS else ".exr",
        tested_by={
            d.rig_name: d.sequence_paths.folder for d in testing(first, options)
        },
        frames=[Path(dataset.paths.folder).name for dataset in frames],
    )
    folder = f"{WORK}/{wildcards.scene}/{wildcards.rig}/settings/exports"
    return settings_file(
        f"{folder}/{source}/{wildcards.format}.json", settings.as_json()
    )


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
    return f"{dataset_of(wildcards).paths.folder}/{source or 'exr'}"


def export_settings(wildcards):
    """Return the settings file of an export."""
    dataset = dataset_of(wildcards)
    source = wildcards.source.rstrip("/") or VIEWS
    reprojection = reprojection_of(wildcards)
    if "format" in wildcards.keys():
        name = wildcards.format
        options = export_of(wildcards)
        roles = {
            "tested_by": {d.rig_name: d.paths.folder for d in tested_by(wildcards)}
        }
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
