"""Counts the members of a family that are built, and lists those that failed."""

from lightfield.configuration.family import summary
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_json, write_text
from lightfield.stages.family import CountMembers


def count(job: CountMembers) -> None:
    """Write and print how many members are built.

    Raises `UserError` if any has failed, and lists those in a file.
    """
    corpus = read_keys(job.corpus, "corpus.py", "members", "failures")
    failures = corpus["failures"]
    text = summary(
        job.settings.family,
        len(corpus["members"]) - len(failures),
        [(failure["name"], failure["cause"]) for failure in failures],
        str(job.failed),
    )
    if failures:
        rows = (f"{each['name']}: {each['stage']}: {each['cause']}\n" for each in failures)
        write_text(job.failed, "".join(rows))
        raise UserError(text)
    job.failed.unlink(missing_ok=True)
    write_json(job.output, {"members": len(corpus["members"])})
    print(text)
