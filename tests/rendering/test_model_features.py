"""What becomes of the features of OBJ, PLY and STL: each case is imported, and seen from above."""

import model_imports
import numpy as np
import pytest
from model_features import IGNORED, NOTED, PAGE, REFUSED, ROWS, SHOWN, page
from PIL import Image

CASES = [
    pytest.param(
        suffix, case, row.outcome, id=f"{name}-{row.features or row.cases[0].said}-{number}"
    )
    for name, (suffix, rows) in ROWS.items()
    for row in rows
    for number, case in enumerate(row.cases)
]


def test_the_page_has_the_tables_of_the_rows():
    assert page(PAGE.read_text()) == PAGE.read_text()


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "case", "outcome"), CASES)
def test_what_becomes_of_a_feature(tmp_path, suffix, case, outcome):
    path = tmp_path / f"model.{suffix}"
    path.write_bytes(case.model if isinstance(case.model, bytes) else case.model.encode())
    if case.library:
        path.with_suffix(".mtl").write_text(case.library)
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    Image.new("L", (4, 4), 128).save(tmp_path / "grey.png")
    Image.new("RGBA", (4, 4), (128, 128, 128, 64)).save(tmp_path / "clear.png")
    settings = {"unit": "metres", "up": "z"}
    if outcome == REFUSED:
        assert case.said in model_imports.refusal(path, **settings)
        return
    record = model_imports.imported(path, **settings)
    if outcome == NOTED:
        (left_out,) = record["left_out"]
        assert case.said in left_out
    else:
        assert outcome in (SHOWN, IGNORED)
        assert record["left_out"] == []
    low, high = np.array(record["box"])
    np.testing.assert_allclose(low, 0, atol=1e-6)
    np.testing.assert_allclose(high, case.box, atol=1e-6)
    check_inputs(case.inputs)
    if case.seen:
        seen = model_imports.seen(tmp_path).mean(axis=(0, 1))
        # Each of 64 samples of a pixel passes a surface, or does not.
        for value, expected in zip(seen, case.seen, strict=True):
            assert expected is None or value == pytest.approx(expected, abs=0.01)


def check_inputs(inputs):
    """Check the values of inputs of the Principled BSDF, or the types of nodes that give them."""
    import bpy

    for name, expected in inputs.items():
        socket = bpy.data.materials["red"].node_tree.nodes["Principled BSDF"].inputs[name]
        if isinstance(expected, str):
            (link,) = socket.links
            assert link.from_node.bl_idname == expected
        else:
            assert socket.default_value == pytest.approx(expected)
