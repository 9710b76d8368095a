"""What docs/reference/scene-formats.md says of each feature is what becomes of it."""

import pytest
import scene_format_features
from model_imports import imported, refusal

pytestmark = pytest.mark.slow

ROWS = [
    pytest.param(row, id=f"{name}: {row.feature}")
    for name, rows in scene_format_features.FORMATS.items()
    for row in rows
]


@pytest.mark.parametrize("row", ROWS)
def test_a_feature_is_shown_noted_or_refused_as_the_page_says(tmp_path, row):
    path = row.write(tmp_path)
    if row.verdict == "refused":
        assert refusal(path)
        return
    record = imported(path)
    assert bool(record["left_out"]) == (row.verdict == "noted")
    # What is shown has been compared with a second reader, which refuses what differs.
    if row.verdict != "noted":
        assert ("unjudged" in record) == (row.verdict == "not compared")


def test_the_page_has_these_tables():
    text = scene_format_features.PAGE.read_text()
    assert scene_format_features.page(text) == text
