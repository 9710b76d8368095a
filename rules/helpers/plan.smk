# What the rules of plan.smk ask of the configuration.


def advice_words():
    """Return the words that name to scripts/plan.py what `snakemake advise` has found."""
    files = {
        f"{d.scene_folder}/{d.rig_name}": f"{RESULTS}/benchmarks/advise/{d.scene_name}.json"
        for d in CHOSEN
    }
    there = [(name, file) for name, file in files.items() if Path(file).exists()]
    return shlex.join(word for pair in there for word in ("--advice", *pair))


def probes():
    """Return name, number of frames, and probe of each chosen rig: a sequence's first frame's."""
    frames = {}
    for dataset in CHOSEN:
        if not dataset.imported:
            frames.setdefault((dataset.scene_folder, dataset.rig_name), []).append(
                dataset
            )
    return [
        (f"{scene}/{rig}", len(datasets), f"{datasets[0].work}/probe.json")
        for (scene, rig), datasets in frames.items()
    ]
