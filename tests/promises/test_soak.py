"""The small form of `make soak`: limited, killed and damaged builds lose nothing."""

import sys

import pytest

import soak


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_a_build_that_is_limited_killed_and_damaged_loses_nothing(capsys, monkeypatch):
    sizes = ("--views", 2, "--limits", 1, "--kills", 1, "--faults", 3)
    monkeypatch.setattr(sys, "argv", ["soak.py", *map(str, sizes)])
    # It fails if something was not found, not repaired, lost, or made twice.
    soak.main()
    lines = capsys.readouterr().out.splitlines()
    rows = [[cell.strip() for cell in line.split("|")[2:-1]] for line in lines if "|" in line]
    assert rows[2:4] == [["1", "1", "1", "0", "0"]] * 2
    assert [sum(map(int, column)) for column in zip(*rows[4:], strict=True)] == [3, 3, 3, 0, 0]
