# What is checked, noted and cleared before the first job.


def check_device():
    """Refuse a device that is not there before the first job, where renders are for this machine.

    Raises `UserError`.
    """
    jobs = needed_jobs()
    device = SETTINGS.device
    if device == "auto" and any(job.rule.name == CHECK_GPU for job in jobs):
        device = "gpu"
    renders = device == "gpu" or any(job.resources.get("gpu") for job in jobs)
    if renders and RUNS_HERE:
        words = [sys.executable, FOLDER / "scripts/check_device.py", device]
        checked = subprocess.run(words, capture_output=True, text=True)
        if checked.returncode:
            *_, problem = checked.stderr.strip().splitlines() or ["it said nothing"]
            raise UserError(problem.removeprefix("error: "))


def check_room():
    """Compare the room on the disks with what this run writes, and warn; raises `UserError`."""
    jobs = [job for job in needed_jobs() if job.rule.name == RENDER]
    datasets = {d.folder: d for d in (dataset_of(job.wildcards) for job in jobs)}
    needs = [(Path(RESULTS), d.missing_bytes) for d in datasets.values()]
    # A built scene, at most.
    needs += [(Path(WORK), 1e8) for _ in {d.scene_name for d in datasets.values()}]
    if jobs and RUNS_HERE:
        # What renders at once writes each its view as Cycles has it: in memory if there is room.
        pixels = max(math.prod(d.rig.camera.resolution) for d in datasets.values())
        at_once = min(len(jobs), max(1, workflow.cores // jobs[0].threads))
        size = at_once * pixels * memory.PASSES_PIXEL_BYTES
        if not room.fast_folder(size):
            needs.append((Path(tempfile.gettempdir()), size))
    for warning in room.check(needs):
        print(f"warning: {warning}", file=sys.stderr)


def keep_shards():
    """Note the shards of the datasets of which this run renders some: they keep these."""
    jobs = [job for job in needed_jobs() if job.rule.name == RENDER]
    datasets = {d.name: d for d in (dataset_of(job.wildcards) for job in jobs)}
    counts = {name: (d.view_count, len(d.shards)) for name, d in datasets.items()}
    if counts:
        shard_counts.note(WORK, counts)
        if STORE:
            ViewStore(STORE).send(SHARDS)


def remove_leftovers():
    """Remove what killed runs have left, and say so."""
    removed = leftovers.remove(map(Path, (RESULTS, WORK)))
    if removed:
        print(
            f"removed {len(removed)} files and folders that killed runs have left",
            file=sys.stderr,
        )
