"""Times, sizes, energies, counts and numbers for people."""

import pytest

from lightfield.core import units


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0 s"),
        (0.00021, "0.21 ms"),
        (0.0123, "12 ms"),
        (0.0999, "0.1 s"),
        (4.22, "4.2 s"),
        (9.96, "10 s"),
        (99.4, "99 s"),
        (99.6, "1 min 40 s"),
        (185, "3 min 05 s"),
        (599.7, "10 min"),
        (13 * 60 + 51, "14 min"),
        (99.6 * 60, "1 h 40 min"),
        (2 * 3600 + 7 * 60, "2 h 07 min"),
        (9 * 3600 + 59.6 * 60, "10 h"),
        (1153 * 3600, "1,153 h"),
    ],
)
def test_a_duration_is_as_exact_as_a_person_needs(seconds, text):
    assert units.duration(seconds) == text


@pytest.mark.parametrize(
    ("size", "text"),
    [
        (0, "0 bytes"),
        (1, "1 byte"),
        (999.6, "1 kB"),
        (12_638_171_136, "12.6 GB"),
        (2e15, "2 PB"),
    ],
)
def test_sizes_go_from_bytes_to_petabytes(size, text):
    assert units.size(size) == text


@pytest.mark.parametrize(
    ("kwh", "text"), [(0, "0 kWh"), (144.2, "144 kWh"), (0.25, "0.25 kWh"), (0.0025, "2.5 Wh")]
)
def test_small_energies_are_watt_hours(kwh, text):
    assert units.energy(kwh) == text


def test_counts_name_what_they_count():
    assert units.count(1, "view") == "1 view"
    assert units.count(0, "view") == "0 views"
    assert units.count(1806, "view") == "1,806 views"


@pytest.mark.parametrize(
    ("value", "text"), [(0.5, "0.5"), (4096, "4096"), (1e9, "1e9"), (-1e6, "-1e6"), (0, "0")]
)
def test_limits_are_exact(value, text):
    assert units.limit(value) == text
    assert float(text) == value
