"""The smoke dataset has the noted sums. The program that compares finds each difference."""

import golden
import numpy as np
import pytest

from lightfield.imaging import images

VIEW = "results/a/exr/view_0000f.exr"
PAGE = '<section id="cost">{}</section><section id="files">{}</section>'


def test_the_smoke_dataset_has_the_noted_sums(smoke):
    """If a difference is wanted, `python tests/golden.py smoke --write` notes the sums anew."""
    said, lines = golden.compare("smoke", golden.Build(smoke))
    assert not lines, said


@pytest.fixture
def build(tmp_path, monkeypatch):
    """A function that writes a build, whose first sums are the noted ones."""
    monkeypatch.setattr(golden, "FOLDER", tmp_path / "golden")

    def build(colour=1, machine="AMD", key="a", seconds=1, files="a file"):
        for folder in ("exr", "report"):
            (tmp_path / "results/a" / folder).mkdir(parents=True, exist_ok=True)
        header = {images.KEY_ATTRIBUTE: key, images.MACHINE_ATTRIBUTE: machine}
        images.write_exr(tmp_path / VIEW, {"R": np.full((2, 2), colour, np.float16)}, header)
        (tmp_path / "results/a/report/costs.json").write_text(f"{seconds}\n")
        (tmp_path / "results/a/report/index.html").write_text(PAGE.format(seconds, files))
        return golden.Build(tmp_path)

    golden.write("a", build())
    build.folder = tmp_path
    return build


def test_times_are_no_difference_and_all_else_is(build):
    assert golden.compare("a", build(seconds=2))[1] == []
    assert golden.compare("a", build(files="files"))[1] == [
        "changed: file results/a/report/index.html"
    ]
    assert golden.compare("a", build(colour=2))[1] == [f"changed: file {VIEW}"]
    assert golden.compare("a", build(key="b"))[1] == [
        f"changed: file {VIEW}",
        f"changed: key {VIEW}",
    ]
    build()
    (build.folder / VIEW).rename(build.folder / "results/a/view.png")
    (build.folder / "results/a/report/costs.json").unlink()
    assert golden.compare("a", golden.Build(build.folder))[1] == [
        f"missing: file {VIEW}",
        "missing: file results/a/report/costs.json",
        f"missing: key {VIEW}",
        "new: file results/a/view.png",
        "new: key results/a/view.png",
    ]


def test_another_machine_is_named_and_may_have_other_bytes(build):
    said, lines = golden.compare("a", build(colour=2, machine="Intel"))
    assert "Intel" in said and "AMD" in said
    assert lines == []
    assert golden.compare("a", build(key="b", machine="Intel"))[1] == [f"changed: key {VIEW}"]


def test_missing_sums_are_a_difference(build):
    said, lines = golden.compare("other", build())
    assert said.startswith("no sums are noted") and len(lines) == 1
