"""On which machines were the views rendered? Those of several kinds differ in last digits."""

from collections import Counter
from collections.abc import Iterable

from lightfield.dataset.lightfield import MACHINE, LightField
from lightfield.validation.result import Check


def check(lightfield: LightField, machines: Iterable[str | None]) -> list[Check]:
    """Count the views by the machine that each one's header names; no check if none does.

    Machines of several kinds, or of another than lightfield.json names, are a warning: all of the
    views are right, but another build would not have the same bytes.
    """
    counts = Counter(sorted(machine for machine in machines if machine))
    if not counts:
        return []
    detail = ", ".join(f"{count} on {machine}" for machine, count in counts.items())
    begun = str(lightfield.content.get(MACHINE, ""))
    # A GPU's name stands before that of the machine that it is in.
    others = [machine for machine in counts if not machine.endswith(begun)]
    warnings = []
    if len(counts) > 1 or others:
        named = f"; lightfield.json names {begun}" if others else ""
        warnings = [f"views of unlike machines may differ in last digits: {detail}{named}"]
    return [Check("machines", True, detail, warnings=warnings, figures=dict(counts))]
