"""Writes times, sizes, energy, counts and numbers as a person reads them."""

import math


def duration(seconds: float) -> str:
    """Return a time with two or three digits: ``4.2 s``, ``3 min 05 s``, ``2 h 07 min``, ``15 h``.

    More digits would change from run to run.
    """
    if 0 < seconds < 0.0995:
        return f"{1000 * seconds:.2g} ms"
    if seconds < 9.95:
        return f"{seconds:.2g} s"
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    minutes = seconds / 60
    if round(seconds) < 600:
        return _two_units(round(seconds), "min", "s")
    if minutes < 99.5:
        return f"{minutes:.0f} min"
    if round(minutes) < 600:
        return _two_units(round(minutes), "h", "min")
    return f"{minutes / 60:,.0f} h"


def _two_units(count: int, large_unit: str, small_unit: str) -> str:
    """Return a whole number of the smaller unit, 60 of which make one of the larger."""
    return f"{count // 60} {large_unit} {count % 60:02d} {small_unit}"


def size(size_bytes: float) -> str:
    """Return a number of bytes with three digits: ``1 byte``, ``586 kB``, ``12.3 MB``."""
    if size_bytes == 1:
        return "1 byte"
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if size_bytes < 999.5:
            return f"{size_bytes:.3g} {unit}"
        size_bytes /= 1000
    return f"{size_bytes:.3g} PB"


def energy(kwh: float) -> str:
    """Return an energy with three digits: ``144 kWh``, ``2.5 Wh``."""
    return f"{kwh:.3g} kWh" if kwh >= 0.01 or not kwh else f"{1000 * kwh:.3g} Wh"


def count(number_of: int, name: str) -> str:
    """Return how many there are of something that has a ``name``: ``1 view``, ``1,806 views``."""
    return f"{number_of:,} {name}" + ("" if number_of == 1 else "s")


def number(value: float) -> str:
    """Return a measured number with a few digits, in powers of ten if very small or large."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "–"
    if 9999.5 <= abs(value) < 99999.5:
        return f"{value:.0f}"
    if value != 0 and not 1e-3 <= abs(value) < 9999.5:
        mantissa, exponent = f"{value:.2e}".split("e")
        return f"{mantissa}·10{_superscript(int(exponent))}"
    return f"{value:z.4g}"


def limit(value: float) -> str:
    """Return the bound of a setting exactly, as a user may write it: ``0.5``, ``4096``, ``1e9``."""
    exponent = math.log10(abs(value)) if value else 0.0
    if exponent.is_integer() and exponent >= 6:
        return f"{'-' if value < 0 else ''}1e{exponent:.0f}"
    return str(value) if isinstance(value, int) else f"{value:.10g}"


def _superscript(value: int) -> str:
    return str(value).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
