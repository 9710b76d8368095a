"""The table of `make consumers`, which needs an environment of its own, has every exporter."""

import importlib.util
import re

from conftest import ROOT

from lightfield.exporters import EXPORTERS

# These have sums of views, whose pixels the tests compare.
WITHOUT_POINTS = {"focal_stack", "quilt"}


def test_each_exporter_is_read_by_make_consumers_and_in_its_documented_table():
    path = ROOT / "tests/consumers/each.py"
    spec = importlib.util.spec_from_file_location("each", path)
    each = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(each)
    read = [name for name, *_ in each.ROWS]
    assert read == sorted({*EXPORTERS} - WITHOUT_POINTS)
    page = (ROOT / "docs/explanation/measured-exports.md").read_text()
    table = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \|", page, re.M)[: len(read)]
    assert [name for name, *_ in table] == read
    assert [ran for *_, ran in table] == [row[3] for row in each.ROWS]
