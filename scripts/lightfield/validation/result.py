"""The result of a validation: a list of checks, and its summary in one line."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_keys
from lightfield.engine import receipts
from lightfield.formats.layout import REPORT, write_sums
from lightfield.stages.publishing import PublishChecksums

# How many problems of a check are printed. validation.json has all of them.
_LINES_A_CHECK = 20
# So many failed checks are named, each with its first problem.
_CAUSES = 3


@dataclass(frozen=True)
class Check:
    """The outcome of a check. ``passed`` is None if it does not apply, and ``detail`` says why.

    - ``views``: the names of the views that failed.
    - ``problems``: lines that each name a file.
    - ``warnings``: lines about what is allowed, but deserves a look.
    - ``figures``: the measured numbers by their names.
    """

    name: str
    passed: bool | None
    detail: str
    views: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of_files(cls, name: str, faults: Mapping[str, str], detail: str, **more: Any) -> "Check":
        """Return a check that fails if there are ``faults``, which map paths of views to texts."""
        views = sorted({Path(path).stem for path in faults})
        problems = [f"{path}: {fault}" for path, fault in faults.items()]
        return cls(name, not faults, detail, views, problems, **more)


@dataclass(frozen=True)
class Result:
    """A dataset's checks, and the SHA-256 of every published file by its relative path."""

    dataset: str
    views: int
    checks: list[Check]
    checksums: dict[str, str]

    @property
    def valid(self) -> bool:
        return all(check.passed is not False for check in self.checks)

    def to_json(self) -> dict[str, Any]:
        """Return the content of validation.json."""
        return {
            "dataset": self.dataset,
            "valid": self.valid,
            "summary": self.summary(),
            "checks": [asdict(check) for check in self.checks],
        }

    def summary(self) -> str:
        """Return the result in one line, for people."""
        parts = [f"{self.views} views"]
        parts += [
            check.name.removesuffix("geometry").replace("/", " ") + check.detail
            for check in self.checks
            if check.name.endswith("geometry") and check.figures
        ]
        for title, passed in (("failed", False), ("not applicable", None)):
            names = [check.name for check in self.checks if check.passed is passed]
            parts += [f"{title}: {', '.join(names)}"] if names else []
        warnings = [warning for check in self.checks for warning in check.warnings]
        parts += [f"warning: {'; '.join(warnings)}"] if warnings else []
        return f"{self.dataset}: {'valid' if self.valid else 'INVALID'}: {'; '.join(parts)}"

    def failures(self) -> list[str]:
        """Return the first problems of each check, one line each.

        A failed check without problems has its detail instead.
        """
        lines = []
        for check in self.checks:
            problems = [check.detail] if check.passed is False else []
            problems = check.problems or problems
            shown = problems[:_LINES_A_CHECK]
            if len(problems) > len(shown):
                shown.append(f"… and {len(problems) - len(shown)} more")
            lines += [f"{self.dataset}: {check.name}: {line}" for line in shown]
        return lines


def causes(validation: Mapping[str, Any]) -> str:
    """Return the first problem of the first failed checks, and the number of other problems.

    A check that names no problem has its detail instead.
    """
    problems_by_check = {
        check["name"]: check["problems"] or [check["detail"]]
        for check in validation["checks"]
        if check["passed"] is False
    }
    parts = [f"{name}: {problems_by_check[name][0]}" for name in [*problems_by_check][:_CAUSES]]
    other_problems = sum(map(len, problems_by_check.values())) - len(parts)
    if other_problems:
        parts.append(f"and {other_problems} more")
    return "; ".join(parts)


def publish(job: PublishChecksums) -> None:
    """Publish the checksums of a valid dataset. Raises `UserError` if it is not valid."""
    validation = read_keys(job.validation, "validate.py", "valid", "dataset", "checks")
    if not validation["valid"]:
        raise UserError(
            f"{validation['dataset']} is not valid, and so gets no checksums: "
            f"{causes(validation)}: see {job.page}"
        )
    outputs = receipts.made_in(
        job.output.parent, [*job.settings.inputs, job.validation], job.work_folder
    )
    sums = {path: output.stamp.sha256 for path, output in outputs.items()}
    published = {path: sums[path] for path in sums if not path.startswith(f"{REPORT}/")}
    write_sums(job.output, published)
