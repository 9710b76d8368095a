# What the rules of report.smk ask of the configuration.


def panorama_settings(dataset):
    """Return the settings of the panorama's lightfield.json."""
    settings = LightfieldSettings.of_capture(
        dataset,
        panorama_width=dataset.panorama_width,
        fingerprint=dataset.builder_fingerprint,
    )
    return settings.as_json()


def panorama_memory(wildcards, attempt):
    """Ask for the memory in MB that the panorama takes, and for more where that was too little."""
    dataset = dataset_of(wildcards)
    need = dataset.estimate.memory_bytes(dataset.panorama_width**2 // 2)
    return math.ceil(need / 1e6) * attempt


def measurements(wildcards):
    """Return the files of those measurements of interest to a dataset that have been made.

    They are no input, for a page must never start a measurement: that takes an hour.
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
    """Return the command that makes a dataset, to be shown on its page."""
    dataset = dataset_of(wildcards)
    snakefile = os.path.relpath(FOLDER / "Snakefile")
    words = [] if snakefile == "Snakefile" else ["-s", snakefile]
    choice = [f"scenes={dataset.scene_name}", f"rigs={dataset.rig_name}"]
    words += ["--cores", "all", "--config", *choice, f"preset={dataset.preset}"]
    return shlex.join(["snakemake", *words])


def page_settings(wildcards):
    """Return the settings file of a page: the scene YAML's text, and which measurements it shows."""
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
