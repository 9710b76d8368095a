# Functions for the rules of plan.smk.


def advice_arguments():
    """Return the arguments that name the files of `error_vs_time` to scripts/plan.py."""
    file_of_rig = {}
    for dataset in CHOSEN:
        name = f"{dataset.scene_folder}/{dataset.rig_name}"
        file_of_rig[name] = (
            f"{RESULTS}/benchmarks/error_vs_time/{dataset.scene_name}.json"
        )
    arguments = []
    for name, file in file_of_rig.items():
        if Path(file).exists():
            arguments += ["--advice", name, file]
    return shlex.join(arguments)


def probes():
    """Return name, number of frames, and probe of each chosen rig.

    The probe of a sequence is that of its first frame.
    """
    frames_of_rig = {}
    for dataset in CHOSEN:
        if not dataset.imported:
            name = f"{dataset.scene_folder}/{dataset.rig_name}"
            frames_of_rig.setdefault(name, []).append(dataset)
    return [
        (name, len(datasets), datasets[0].paths.probe)
        for name, datasets in frames_of_rig.items()
    ]
