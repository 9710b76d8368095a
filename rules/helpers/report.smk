# Functions for the rules of report.smk.


def panorama_settings(dataset):
    """Return the settings of the panorama's lightfield.json."""
    settings = LightfieldSettings.of_capture(
        dataset,
        panorama_width=dataset.panorama_width,
        fingerprint=dataset.builder_fingerprint,
    )
    return settings.as_json()


def panorama_memory(wildcards, attempt):
    """Return the memory of the panorama in MB. Each retry requests more."""
    return cost("render_panorama", dataset_of(wildcards)).megabytes(attempt)


def measurements(wildcards):
    """Return the files of the finished measurements that concern a dataset.

    They are not inputs: a page must never start a measurement, which takes an hour.
    """
    dataset = dataset_of(wildcards)
    stems = ["reprojection", "stability", f"error_vs_time/{dataset.scene_name}"]
    for kind in ("synthesis", "learn"):
        stems.append(f"{kind}/{dataset.scene_folder}/{dataset.rig_folder}")
    files = [
        Path(RESULTS, "benchmarks", f"{stem}{suffix}")
        for stem in stems
        for suffix in (".csv", ".json", ".svg", ".png")
    ]
    return [file for file in files if file.exists()]


def rebuilding(wildcards):
    """Return the command that makes a dataset, for its page."""
    dataset = dataset_of(wildcards)
    snakefile = os.path.relpath(FOLDER / "Snakefile")
    arguments = [] if snakefile == "Snakefile" else ["-s", snakefile]
    choice = [f"scenes={dataset.scene_name}", f"rigs={dataset.rig_name}"]
    arguments += ["--cores", "all", "--config", *choice, f"preset={dataset.preset}"]
    return shlex.join(["snakemake", *arguments])


def page_settings(wildcards):
    """Return the settings file of a page: the scene YAML's text, and the measurements to show."""
    dataset = dataset_of(wildcards)
    settings = PageSettings(
        rig=dataset.placed_rig,
        yaml=scene_path(dataset.scene_name).read_text(),
        command=rebuilding(wildcards),
        panorama=bool(dataset.panorama),
        measurements=[
            Measurement(file=str(path), modified_ns=path.stat().st_mtime_ns)
            for path in measurements(wildcards)
        ],
    )
    return dataset_settings(dataset, "page", settings.as_json())
