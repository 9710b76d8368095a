"""The diffs in CONTRIBUTING.md apply to the code as it is, and the tests in them pass."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DIFFS = re.findall(r"^```diff\n(.*?)^```$", (ROOT / "CONTRIBUTING.md").read_text(), re.M | re.S)


def test_a_lens_a_setting_and_an_exporter_have_an_example():
    assert len(DIFFS) == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "tests"),
    [
        (0, ["tests/geometry/test_lenses.py", "tests/publishing/test_reader.py", "-k", "thoby"]),
        (1, ["tests/export/test_exports.py", "-k", "decimals"]),
        (2, ["tests/export/test_exports.py", "-k", "tum"]),
    ],
    ids=["lens", "setting", "exporter"],
)
def test_an_example_applies_and_its_tests_pass(number, tests, tmp_path):
    for name in ("scripts", "tests", "pyproject.toml"):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    subprocess.run(["git", "apply", "-"], input=DIFFS[number], text=True, cwd=tmp_path, check=True)
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout
    assert " passed" in result.stdout
