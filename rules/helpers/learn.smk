# What the rules of learn.smk ask of the configuration, and the environment that has torch.

CONSUMERS = FOLDER / ".venv-consumers"
CONSUMERS_PYTHON = shlex.quote(os.path.relpath(CONSUMERS / "bin/python"))


def check_consumers():
    """Refuse to learn without the consumers' environment; raises `UserError`."""
    learns = any(job.rule.name == MEASURE_LEARNING for job in needed_jobs())
    if learns and not (CONSUMERS / "complete").exists():
        raise UserError(
            f"learn: torch is missing: set up {os.path.relpath(CONSUMERS)} "
            f"with `make -C {shlex.quote(os.path.relpath(FOLDER))} .venv-consumers/complete`"
        )


def learned_from(dataset):
    """Return the manifests of a dataset's exports with depth that benchmarks/learn.py reads."""
    wanted = dataset.exports.nerfstudio
    files = dataset.exported if wanted and wanted.depth else []
    return [path for path in files if path.endswith(f"exports/nerfstudio/{MANIFEST}")]
