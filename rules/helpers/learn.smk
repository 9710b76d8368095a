# Functions for the rules of learn.smk, and the environment that has torch.

CONSUMERS = FOLDER / ".venv-consumers"
CONSUMERS_PYTHON = shlex.quote(os.path.relpath(CONSUMERS / "bin/python"))


def check_consumers():
    """Raise `UserError` for a job that learns without the consumers' environment."""
    learns = any(is_of(job, "measure_learning") for job in needed_jobs())
    if learns and not (CONSUMERS / "complete").exists():
        raise UserError(
            f"learn: torch is missing: set up {os.path.relpath(CONSUMERS)} "
            f"with `make -C {shlex.quote(os.path.relpath(FOLDER))} .venv-consumers/complete`"
        )


def learned_from(dataset):
    """Return the manifests of a dataset's exports with depth that benchmarks/learn.py reads."""
    options = dataset.exports.nerfstudio
    if options is None or not options.depth:
        return []
    manifest = f"exports/nerfstudio/{MANIFEST}"
    return [path for path in dataset.exported if path.endswith(manifest)]
