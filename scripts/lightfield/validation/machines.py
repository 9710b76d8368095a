"""Counts the machines that rendered the views. Different machines differ in the last digits."""

from collections import Counter
from collections.abc import Iterable

from lightfield.formats.lightfield import MACHINE, LightField
from lightfield.validation.result import Check


def check(lightfield: LightField, machines: Iterable[str | None]) -> list[Check]:
    """Count the views by the machine in their headers. Return no check if no header names one.

    Warns about several machines, and about a machine that lightfield.json does not name. Such views
    are right, but another build would not have the same bytes.
    """
    counts = Counter(sorted(machine for machine in machines if machine))
    if not counts:
        return []
    detail = ", ".join(f"{count} on {machine}" for machine, count in counts.items())
    first_machine = str(lightfield.content.get(MACHINE, ""))
    # A GPU's name precedes the name of its machine.
    unnamed_machines = [machine for machine in counts if not machine.endswith(first_machine)]
    warnings = []
    if len(counts) > 1 or unnamed_machines:
        addition = f"; lightfield.json names {first_machine}" if unnamed_machines else ""
        warnings = [f"views of unlike machines may differ in last digits: {detail}{addition}"]
    return [Check("machines", True, detail, warnings=warnings, figures=dict(counts))]
