# What no public interface of Snakemake gives: the only file that reaches inside, each with its reason.


def rerun(outputs):
    """Have Snakemake run the jobs of these outputs, although it sees no reason.

    --forcerun is the public way, but what it names becomes a target, too.
    """
    workflow.dag.forcefiles.update(map(stored, outputs))


def is_ancient(file):
    """Return whether a rule declares that an input's age, and so its content, is no matter."""
    return file.is_ancient


def unstored(file):
    """Return the path of an input or output as the rules have it, without Snakemake's storage."""
    return str(file).removeprefix(stored(WORK).removesuffix(WORK))
