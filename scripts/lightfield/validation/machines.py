"""Counts the machines that rendered the views. Different machines differ in the last digits."""

from collections import Counter
from collections.abc import Iterable

from lightfield.dataset.lightfield import MACHINE, LightField
from lightfield.validation.result import Check


def check(lightfield: LightField, machines: Iterable[str | None]) -> list[Check]:
    """Count the views by the machine in their headers. No check if no header names one.

    Warns if there are different machines, or others than lightfield.json names. The views are
    right, but another build would not have the same bytes.
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
