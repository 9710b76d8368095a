"""What a dataset's page says in tables: checks, measurements and costs, each from its file."""

import csv
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, read_problem
from lightfield.measurement import summaries
from lightfield.report import page

# Of the stability table, so many of the cases that use most of their bound are shown at once.
WORST_CASES = 12

CHECK_KEYS = ("passed", "detail", "views", "problems", "warnings", "figures")
# The tables of error_vs_time that are shown at once, in this order, by their names there.
ERROR_TABLES = {
    "slopes": "Slope of the error, both axes logarithmic; plain path tracing's is −1 in theory",
    "settings": "This scene's settings",
    "pareto front": "On the Pareto front: no other method is both faster and better",
}


@dataclass(frozen=True)
class Table:
    """Column titles and rows of cells; ``rows`` may hold numbers, text, or None."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Measurement:
    """One measurement: its plot as a data URI, and tables by their titles; whole ones apart."""

    plot: str | None
    tables: dict[str, Table] = field(default_factory=dict)
    whole: dict[str, Table] = field(default_factory=dict)
    facts: Sequence[tuple[str, str]] = ()


def validation(path: Path) -> dict[str, Any] | None:
    """Return validation.json's content with its checks grouped by the image set they are of."""
    if not path.is_file():
        return None
    content = read_json(path)
    groups: dict[str, list[dict[str, Any]]] = {}
    try:
        for check in content["checks"]:
            group, _, name = check["name"].rpartition("/")
            kept = {key: check[key] for key in CHECK_KEYS}
            groups.setdefault(group, []).append({**kept, "short": name})
        return {"valid": content["valid"], "groups": groups}
    except (LookupError, TypeError, AttributeError):
        raise UserError(f"{path}: is not what scripts/validate.py writes") from None


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
        {f"All {len(rows)} measurements": _whole(rows)},
    )


def stability(files: Sequence[Path]) -> Measurement | None:
    """Return what the lenses' extremes showed: counts of verdicts, and the worst cases."""
    path = _named(files, "stability.csv")
    if path is None:
        return None
    rows = _read_csv(path, "group", "verdict")
    counts = Counter((row["group"], row.get("dtype", ""), row["verdict"]) for row in rows)
    kinds = sorted(
        {verdict for _, _, verdict in counts}, key=lambda verdict: (len(verdict), verdict)
    )
    summary = Table(
        ["cases", "precision", *kinds],
        [
            [*case, *(counts[*case, kind] for kind in kinds)]
            for case in dict.fromkeys(key[:2] for key in counts)
        ],
    )
    worst = sorted(rows, key=_bound_used, reverse=True)[:WORST_CASES]
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
        {f"All {len(rows)} cases": _whole(rows)},
        [("cases", str(len(rows))), ("outside their bound", str(failed))],
    )


def synthesis(files: Sequence[Path], folder: str) -> Measurement | None:
    """Return how well views are synthesised from a dataset, which is in ``folder``: scene/rig."""
    path = _named(files, f"synthesis/{folder}.csv")
    if path is None:
        return None
    names = summaries.MEANS
    columns = [*summaries.COLUMNS, *names]
    rows = _read_csv(path, *columns, "place", "region")
    means = [[row[name] for name in columns] for row in summaries.means(rows)]
    plain = [row for row in rows if row["variant"] == "all"]
    by_place = [
        [mean["truth"], place, *(mean[name] for name in names)]
        for place in summaries.PLACES
        for mean in summaries.means([row for row in plain if row["place"] == place])
    ]
    by_region = [
        [mean["truth"], region, *(mean[name] for name in ("part", *names))]
        for region in dict.fromkeys(row["region"] for row in plain)
        for mean in summaries.means(plain, region)
    ]
    found = {
        "Views that were held out, synthesised from this dataset's": Table(columns, means),
        "Inside, and towards the edge of the interpolation volume": Table(
            ["truth", "place", *names], by_place
        ),
    }
    if {row["region"] for row in plain} > {summaries.WHOLE}:
        title = "Apart for the kind of light that a pixel shows most of"
        found[title] = Table(["truth", "region", "part", *names], by_region)
    return Measurement(page.plot(path.with_suffix("")), found)


def learning(files: Sequence[Path], folder: str) -> Measurement | None:
    """Return how well fields are learned from the exports of a dataset in ``folder``: scene/rig."""
    path = _named(files, f"learn/{folder}.csv")
    if path is None:
        return None
    rows = _read_csv(path, "learned", "held_out", "reading", "step", "psnr")
    last = {
        (row["learned"], row["held_out"], row["reading"]): float(row["psnr"])
        for row in sorted(rows, key=lambda row: int(row["step"]))
    }
    return Measurement(
        page.plot(path.with_suffix("")),
        {
            "Held-out rays after the last step": Table(
                ["learned from", "held out", "read", "PSNR, dB"],
                [[*names, f"{psnr:.1f}"] for names, psnr in last.items()],
            )
        },
    )


def error_vs_time(files: Sequence[Path], scene: str) -> Measurement | None:
    """Return the error of a scene's renders against their run time, as far as it was measured."""
    path = _named(files, f"error_vs_time/{scene}.json")
    if path is None:
        return None
    content = read_json(path)
    if not isinstance(content, Mapping):
        raise UserError(f"{path}: must be a mapping")
    # Strata have tables of their own.
    tables, _ = _tables({name: part for name, part in content.items() if name != "strata"})
    known = {name: table for name, table in tables.items() if name in ERROR_TABLES}
    whole = {name: table for name, table in tables.items() if name not in known}
    whole.pop("measured on", None)
    if "slopes" in known:
        try:
            known["slopes"] = _slopes(content["slopes"])
        except (TypeError, ValueError):
            raise UserError(
                f"{path}: slopes: is not what scripts/error_vs_time.py writes"
            ) from None
    measured_on = content.get("measured_on")
    shown = {ERROR_TABLES[name]: known[name] for name in ERROR_TABLES if name in known}
    if content.get("strata"):
        try:
            shown["By what pixels show"] = Table(*summaries.strata_table(content))
        except (LookupError, TypeError, AttributeError):
            raise UserError(f"{path}: is not what scripts/error_vs_time.py writes") from None
    return Measurement(
        page.plot(path.with_suffix("")),
        shown,
        {name.capitalize(): table for name, table in whole.items()},
        _with_units(measured_on, "") if isinstance(measured_on, Mapping) else [],
    )


def _slopes(slopes: Mapping[str, Any]) -> Table:
    """Return each method's slopes, ± their standard errors."""
    over = (
        "over_time",
        "over_samples",
        "of_all_pixels_over_time",
        "of_all_pixels_over_samples",
    )

    def text(fit: Any) -> str | None:
        if not isinstance(fit, Mapping) or "slope" not in fit:
            return None
        return f"{fit['slope']:.2f} ± {fit.get('slope_error', math.nan):.2f}".replace("-", "−")

    return Table(
        ["method", *(name.replace("_", " ") for name in over)],
        [
            [method, *(text(fits.get(name)) for name in over)]
            for method, fits in slopes.items()
            if isinstance(fits, Mapping)
        ],
    )


def costs(path: Path) -> dict[str, Any] | None:
    """Return what costs.json says, or None where no costs were counted.

    ``tables`` by title; ``facts`` and ``full`` (of the dataset at full size, extrapolated) as
    pairs of title and text; ``notes`` and ``basis``, how they were counted.
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
    currency = str(content.get("currency") or "")
    return {
        "tables": tables,
        "facts": _with_units(facts, currency),
        "notes": _sentences(facts),
        # Renders of another size say no more than two digits of it.
        "full": _with_units(
            {k: float(f"{v:.2g}") if isinstance(v, float) else v for k, v in full.items()}, currency
        ),
        "basis": _sentences(full),
    }


def _with_units(facts: Mapping[str, Any], currency: str) -> list[tuple[str, str]]:
    """Return titles and figures in the units that their names end in."""
    found = []
    for name, value in facts.items():
        if name.endswith("_uncertainty") or name == "currency" or _is_sentence(value):
            continue
        sides = name == "resolution" and isinstance(value, list)
        text = " × ".join(map(str, value)) if sides else page.measure(value, name)
        if "price" in name:
            text = f"{text} {currency}"
        found.append((page.title(name), text))
    return found


def _sentences(facts: Mapping[str, Any]) -> list[str]:
    return [value for value in facts.values() if _is_sentence(value)]


def _is_sentence(value: Any) -> bool:
    return isinstance(value, str) and len(value) > 40


def _tables(content: Mapping[str, Any]) -> tuple[dict[str, Table], dict[str, Any]]:
    """Split a JSON mapping into tables (lists of mappings, mappings of mappings) and the rest."""
    tables, facts = {}, {}
    for name, value in content.items():
        title = str(name).replace("_", " ")
        rows = value
        if isinstance(value, Mapping) and value:
            of_rows = all(isinstance(row, Mapping) for row in value.values())
            rows = [{"": key, **row} for key, row in value.items()] if of_rows else [value]
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
    """Return the rows of a CSV; one without a row, or one of the ``columns``, is a `UserError`."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [
                {str(key): value or "" for key, value in row.items() if key}
                for row in csv.DictReader(file)
            ]
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: cannot be read as CSV: {error}") from None
    if not rows:
        raise UserError(f"{path}: has no row")
    for column in columns:
        if column not in rows[0]:
            raise UserError(f"{path}: {column}: is missing; it is a column of the measurement's")
    return rows


def _whole(rows: Sequence[Mapping[str, str]]) -> Table:
    """Return a CSV's rows as they are."""
    return Table(list(rows[0]), [list(row.values()) for row in rows])


def _bound_used(row: Mapping[str, str]) -> float:
    """Return the largest part of its bounds that a case of the stability table uses."""
    used = []
    for error, bound in (("error", "error_bound"), ("round_trip_error", "round_trip_bound")):
        try:
            part = float(row.get(error, "")) / float(row.get(bound, ""))
        except (ValueError, ZeroDivisionError):
            continue
        if math.isfinite(part):
            used.append(part)
    return max(used, default=0.0)


def _milliseconds(text: str | None) -> str | None:
    try:
        return f"{page.number(1000 * float(text or ''))} ms"
    except ValueError:
        return text
