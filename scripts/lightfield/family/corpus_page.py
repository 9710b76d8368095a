"""Makes the page of a corpus: thumbnails with filters, distributions, and failures with causes.

The thumbnails are files beside the page, which a browser loads when they come into sight. So the
page stays light with thousands of members.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from lightfield.configuration.corpus import PAGE
from lightfield.core import units
from lightfield.core.names import PARTS
from lightfield.formats.layout import REPORT
from lightfield.report import page

# The size of a histogram in units of its SVG.
WIDTH = 240
HEIGHT = 80
# More values than these of a name are put together as the last bar.
_MOST_COUNTS = 8
TITLES = {
    "nearest_metres": "Distance of the nearest surface, in metres",
    "farthest_metres": "Distance of the farthest surface, in metres",
    "brightness": "Brightness: mean luminance",
    "over_exposed": "Share of pixels beyond white",
    "covered": "Share of pixels with a surface",
}


def write(folder: Path, content: Mapping[str, Any]) -> None:
    """Write the page of the family in ``folder``. ``content`` is its corpus.json."""
    numbers = content["statistics"]
    pictures = numbers["pictures"].items()
    keys = _filtered_keys(numbers["values"])
    page.write(
        folder / PAGE,
        "corpus.html.j2",
        name=content["name"],
        description=content.get("description"),
        licence=content.get("licence"),
        credit=content.get("credit"),
        numbers=numbers,
        size=units.size(numbers["bytes"]),
        parts=[(part, content["splits"]["valid_members"][part]) for part in PARTS],
        keys=keys,
        distributions=[
            *((key, _drawn(key, value)) for key, value in numbers["values"].items()),
            *((TITLES[key], _drawn(TITLES[key], value)) for key, value in pictures if _has(value)),
        ],
        failures=content["failures"],
        members=[_row(folder, member, keys) for member in content["members"]],
    )


def _filtered_keys(values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the drawn values by which the page filters, with their choices or bounds."""
    return [
        {
            "key": key,
            "title": key.removeprefix("scene.").removeprefix("parameters."),
            "choices": list(distribution["counts"]) if "counts" in distribution else None,
            "least": distribution.get("least"),
            "largest": distribution.get("largest"),
        }
        for key, distribution in values.items()
    ]


def _row(
    folder: Path, member: Mapping[str, Any], keys: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the facts of a member that the page's program shows and filters by."""
    link = f"{member['name']}/"
    for rig in member.get("datasets", {}):
        if (folder / member["name"] / rig / REPORT / "index.html").is_file():
            link = f"{member['name']}/{rig}/{REPORT}/index.html"
            break
    return {
        "name": member["name"],
        "source": str(member.get("model", f"seed {member.get('seed')}")),
        "state": member["state"],
        "split": member["split"],
        "views": sum(dataset["views"] for dataset in member.get("datasets", {}).values()),
        "values": [_shown_value(member["values"].get(key["key"]), key) for key in keys],
        "link": quote(link),
        "thumbnail": quote(member["thumbnail"]) if "thumbnail" in member else None,
    }


def _shown_value(value: Any, key: Mapping[str, Any]) -> Any:
    return value if value is None or key["choices"] is None else value_text(value)


def value_text(value: Any) -> str:
    """Return a drawn value that is not a number as text."""
    return value if isinstance(value, str) else json.dumps(value)


def _has(distribution: Mapping[str, Any]) -> bool:
    return bool(distribution.get("histogram") or distribution.get("counts"))


def _drawn(title: str, distribution: Mapping[str, Any]) -> Markup:
    """Return a distribution as an SVG: the histogram of numbers, or a bar for each other value."""
    if "histogram" in distribution:
        bars = distribution["histogram"]
        least, median, largest = (
            units.number(distribution[key]) for key in ("least", "median", "largest")
        )
        names = [least, f"median {median}", largest]
        label = f"{title}: from {least} to {largest}, median {median}"
    else:
        counts = _most_frequent(distribution["counts"])
        bars = [count for _, count in counts]
        names = [name for name, _ in counts]
        label = f"{title}: " + ", ".join(f"{name} {count}" for name, count in counts)
    step = WIDTH / len(bars)
    highest = max(bars)
    rectangles = Markup("").join(
        Markup('<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"/>').format(
            number * step,
            HEIGHT - bar / highest * HEIGHT,
            max(step - 1, 0.5),
            bar / highest * HEIGHT,
        )
        for number, bar in enumerate(bars)
    )
    labels = Markup("").join(Markup("<span>{}</span>").format(name) for name in names)
    return Markup(
        '<svg viewBox="0 0 {} {}" role="img" aria-label="{}" preserveAspectRatio="none">{}</svg>'
        '<div class="ticks">{}</div>'
    ).format(WIDTH, HEIGHT, label, rectangles, labels)


def _most_frequent(counts: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return the most frequent values with their counts, and the sum of the others."""
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    rest = ordered[_MOST_COUNTS:]
    if not rest:
        return ordered
    return [*ordered[:_MOST_COUNTS], ("others", sum(count for _, count in rest))]
