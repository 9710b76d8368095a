# What the rules of learn.smk ask of the configuration.


def learned_from(dataset):
    """Return the manifests of a dataset's exports with depth that benchmarks/learn.py reads."""
    wanted = dataset.exports.nerfstudio
    files = dataset.exported if wanted and wanted.depth else []
    return [path for path in files if path.endswith(f"exports/nerfstudio/{MANIFEST}")]
