"""Reads the tables of a dataset's page from files: checks, measurements and costs."""

import csv
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, read_text
from lightfield.measurement import summaries
from lightfield.report import page

# The page shows this many of the cases that use most of their bound. The full table is folded.
_WORST_CASES = 12

_CHECK_KEYS = ("passed", "detail", "views", "problems", "warnings", "figures")
# The unfolded tables of error_vs_time, in this order, by their names in its file.
_ERROR_TABLES = {
    "slopes": "Slope of the error, both axes logarithmic; plain path tracing's is −1 in theory",
    "settings": "This scene's settings",
    "pareto front": "On the Pareto front: no other method is both faster and better",
}


@dataclass(frozen=True)
class Table:
    """Column titles and rows of cells. A cell is a number, text, or None."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Measurement:
    """One measurement: its plot as a data URI, and tables by their titles.

    The page folds the ``full_tables``.
    """

    plot: str | None
    tables: dict[str, Table] = field(default_factory=dict)
    full_tables: dict[str, Table] = field(default_factory=dict)
    facts: Sequence[tuple[str, str]] = ()


def validation(path: Path) -> dict[str, Any] | None:
    """Return the content of validation.json, with its checks grouped by image set."""
    if not path.is_file():
        return None
    content = read_json(path)
    groups: dict[str, list[dict[str, Any]]] = {}
    try:
        for check in content["checks"]:
            group, _, name = check["name"].rpartition("/")
            figures = {key: check[key] for key in _CHECK_KEYS}
            groups.setdefault(group, []).append({**figures, "short": name})
        return {"valid": content["valid"], "groups": groups}
    except (LookupError, TypeError, AttributeError):
        raise UserError(f"{path}: is not what scripts/validate.py writes") from None


def state(path: Path) -> str:
    """Return what validation.json says of a dataset: valid, not valid, or not validated."""
    content = validation(path)
    if content is None:
        return "not validated"
    return "valid" if content["valid"] else "not valid"


def reprojection(files: Sequence[Path]) -> Measurement | None:
    """Return the error of reprojection against its run time: the best methods of each case."""
    path = _named(files, "reprojection.csv")
    if path is None:
        return None
    rows = _read_csv(path, "scenario", "method", "on_front")
    names = ("scenario", "method", "samples", "rms_error", "largest_error")
    best = Table(
        ["case", "method", "samples", "RMS error", "largest error", "CPU time a view"],
        [
            [*map(row.get, names), _milliseconds(row.get("view_cpu_s"))]
            for row in rows
            if row["on_front"] == "True"
        ],
    )
    return Measurement(
        page.plot(path.with_suffix("")),
        {"On the Pareto front: no other method is both faster and better": best},
        {f"All {len(rows)} measurements": _full_table(rows)},
    )


def stability(files: Sequence[Path]) -> Measurement | None:
    """Return the measurement of lenses at their extremes: counts of verdicts, and worst cases."""
    path = _named(files, "stability.csv")
    if path is None:
        return None
    rows = _read_csv(path, "group", "verdict")
    counts = Counter((row["group"], row.get("dtype", ""), row["verdict"]) for row in rows)
    kinds = sorted(
        {verdict for _, _, verdict in counts}, key=lambda verdict: (len(verdict), verdict)
    )
    summary_rows = []
    for group, precision in dict.fromkeys(key[:2] for key in counts):
        numbers = [counts[group, precision, kind] for kind in kinds]
        summary_rows.append([group, precision, *numbers])
    summary = Table(["cases", "precision", *kinds], summary_rows)
    worst = sorted(rows, key=_bound_used, reverse=True)[:_WORST_CASES]
    names = ("case", "dtype", "condition", "error", "error_bound", "unit", "verdict")
    shown = [[*map(row.get, names), f"{_bound_used(row):.0%}"] for row in worst]
    failed = sum(not row["verdict"].startswith("ok") for row in rows)
    return Measurement(
        page.plot(path.with_suffix("")),
        {
            "Verdicts": summary,
            "The cases that use most of what their condition number allows": Table(
                ["case", "precision", "condition", "error", "bound", "unit", "verdict", "of bound"],
                shown,
            ),
        },
        {f"All {len(rows)} cases": _full_table(rows)},
        [("cases", str(len(rows))), ("outside their bound", str(failed))],
    )


def synthesis(files: Sequence[Path], folder: str) -> Measurement | None:
    """Return how well views are synthesised from a dataset. ``folder`` is scene/rig."""
    path = _named(files, f"synthesis/{folder}.csv")
    if path is None:
        return None
    names = summaries.MEANS
    columns = [*summaries.COLUMNS, *names]
    rows = _read_csv(path, *columns, "place", "region")
    means = [[row[name] for name in columns] for row in summaries.means(rows)]
    all_views = [row for row in rows if row["variant"] == "all"]
    by_place = []
    for place in summaries.PLACES:
        rows_of_place = [row for row in all_views if row["place"] == place]
        for mean in summaries.means(rows_of_place):
            by_place.append([mean["truth"], place, *(mean[name] for name in names)])
    by_region = []
    for region in dict.fromkeys(row["region"] for row in all_views):
        for mean in summaries.means(all_views, region):
            by_region.append([mean["truth"], region, *(mean[name] for name in ("part", *names))])
    tables = {
        "Held-out views, synthesised from this dataset's views": Table(columns, means),
        "Inside, and towards the edge of the interpolation volume": Table(
            ["truth", "place", *names], by_place
        ),
    }
    if {row["region"] for row in all_views} > {summaries.ALL_PIXELS}:
        title = "By the kind of light that dominates a pixel"
        tables[title] = Table(["truth", "region", "part", *names], by_region)
    return Measurement(page.plot(path.with_suffix("")), tables)


def error_vs_time(files: Sequence[Path], scene: str) -> Measurement | None:
    """Return the error of a scene's renders against their run time. None if it was not measured."""
    path = _named(files, f"error_vs_time/{scene}.json")
    if path is None:
        return None
    content = read_json(path)
    if not isinstance(content, Mapping):
        raise UserError(f"{path}: must be a mapping")
    # Strata have tables of their own.
    tables, _ = _tables({name: part for name, part in content.items() if name != "strata"})
    unfolded = {name: table for name, table in tables.items() if name in _ERROR_TABLES}
    folded = {name: table for name, table in tables.items() if name not in unfolded}
    folded.pop("measured on", None)
    if "slopes" in unfolded:
        try:
            unfolded["slopes"] = _slopes(content["slopes"])
        except (TypeError, ValueError):
            raise UserError(
                f"{path}: slopes: is not what scripts/error_vs_time.py writes"
            ) from None
    measured_on = content.get("measured_on")
    shown = {_ERROR_TABLES[name]: unfolded[name] for name in _ERROR_TABLES if name in unfolded}
    if content.get("strata"):
        try:
            shown["By what pixels show"] = Table(*summaries.strata_table(content))
        except (LookupError, TypeError, AttributeError):
            raise UserError(f"{path}: is not what scripts/error_vs_time.py writes") from None
    return Measurement(
        page.plot(path.with_suffix("")),
        shown,
        {name.capitalize(): table for name, table in folded.items()},
        _with_units(measured_on) if isinstance(measured_on, Mapping) else [],
    )


def _slopes(slopes: Mapping[str, Any]) -> Table:
    """Return each method's slopes, with their standard errors."""
    over = (
        "over_time",
        "over_samples",
        "of_all_pixels_over_time",
        "of_all_pixels_over_samples",
    )

    def text(fit: Any) -> str | None:
        if not isinstance(fit, Mapping) or "slope" not in fit:
            return None
        return f"{fit['slope']:z.2f} ± {fit.get('slope_error', math.nan):.2f}".replace("-", "−")

    rows = []
    for method, fits in slopes.items():
        if isinstance(fits, Mapping):
            rows.append([method, *(text(fits.get(name)) for name in over)])
    return Table(["method", *(name.replace("_", " ") for name in over)], rows)


def costs(path: Path) -> dict[str, Any] | None:
    """Return the content of costs.json for the page, or None without the file.

    - ``tables``: by their titles.
    - ``facts``, ``full``: pairs of title and text. ``full`` is extrapolated to the full size.
    - ``notes``: how ``facts`` were counted.
    - ``basis``: how ``full`` was counted. None without it.
    """
    if not path.is_file():
        return None
    content = read_json(path)
    full = content.get("extrapolation") if isinstance(content, Mapping) else None
    if not isinstance(content, Mapping) or not isinstance(full, Mapping | None):
        raise UserError(f"{path}: is not what scripts/costs.py writes")
    tables, facts = _tables(
        {key: value for key, value in content.items() if key != "extrapolation"}
    )
    full = full or {}
    return {
        "tables": tables,
        "facts": _with_units(facts),
        "notes": _sentences(facts),
        # An extrapolation is exact to two digits at most.
        "full": _with_units({name: _two_digits(value) for name, value in full.items()}),
        "basis": full.get("basis"),
    }


def _two_digits(value: Any) -> Any:
    return float(f"{value:.2g}") if isinstance(value, float) else value


def _with_units(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return titles and figures. A figure has the unit at the end of its name."""
    titled_figures = []
    for name, value in facts.items():
        if name.endswith("_uncertainty") or _is_sentence(value):
            continue
        if name == "resolution" and isinstance(value, list):
            text = " × ".join(map(str, value))
        else:
            text = page.measure(value, name)
        titled_figures.append((page.title(name), text))
    return titled_figures


def _sentences(facts: Mapping[str, Any]) -> list[str]:
    return [value for value in facts.values() if _is_sentence(value)]


def _is_sentence(value: Any) -> bool:
    return isinstance(value, str) and len(value) > 40


def _tables(content: Mapping[str, Any]) -> tuple[dict[str, Table], dict[str, Any]]:
    """Split a JSON mapping into tables (lists or mappings of mappings) and single facts."""
    tables = {}
    facts = {}
    for name, value in content.items():
        title = str(name).replace("_", " ")
        rows = value
        if isinstance(value, Mapping) and value:
            if all(isinstance(row, Mapping) for row in value.values()):
                rows = [{"": key, **row} for key, row in value.items()]
            else:
                rows = [value]
        if isinstance(rows, list) and rows and all(isinstance(row, Mapping) for row in rows):
            columns = list(dict.fromkeys(str(key) for row in rows for key in row))
            tables[title] = Table(
                columns, [[row.get(column) for column in columns] for row in rows]
            )
        elif not isinstance(value, list | Mapping) and value is not None:
            facts[str(name)] = value
    return tables, facts


def _named(files: Sequence[Path], ending: str) -> Path | None:
    return next((file for file in files if f"/{file.as_posix()}".endswith(f"/{ending}")), None)


def _read_csv(path: Path, *columns: str) -> list[dict[str, str]]:
    """Return the rows of a CSV. Raises `UserError` if it has no row, or lacks a column."""
    try:
        with StringIO(read_text(path), newline="") as file:
            rows = [
                {str(key): value or "" for key, value in row.items() if key}
                for row in csv.DictReader(file)
            ]
    except csv.Error as error:
        raise UserError(f"{path}: cannot be read as CSV: {error}") from None
    if not rows:
        raise UserError(f"{path}: has no row")
    for column in columns:
        if column not in rows[0]:
            raise UserError(f"{path}: {column}: is missing; it is a column of the measurement's")
    return rows


def _full_table(rows: Sequence[Mapping[str, str]]) -> Table:
    """Return all rows of a CSV."""
    return Table(list(rows[0]), [list(row.values()) for row in rows])


def _bound_used(row: Mapping[str, str]) -> float:
    """Return the largest ratio of error to bound of a case of the stability table."""
    ratios = []
    for error, bound in (("error", "error_bound"), ("round_trip_error", "round_trip_bound")):
        try:
            ratio = float(row.get(error, "")) / float(row.get(bound, ""))
        except (ValueError, ZeroDivisionError):
            continue
        if math.isfinite(ratio):
            ratios.append(ratio)
    return max(ratios, default=0.0)


def _milliseconds(text: str | None) -> str | None:
    try:
        return f"{units.number(1000 * float(text or ''))} ms"
    except ValueError:
        return text
