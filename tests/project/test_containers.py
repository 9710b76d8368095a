"""Jobs in containers: with Snakemake's --sdm apptainer, each job runs with the image's Python."""

import os
import sys

import pytest
from checkouts import checkout, snakemake

TARGET = "results/smoke/LFPlane_3x2_equisolid/lightfield.json"
# Stands in for Apptainer: an image is a folder of programs, and only these can run.
APPTAINER = """#!/bin/sh
case "$1" in
--version) echo "apptainer version 1.4.5"; exit ;;
esac
for word; do command=$word; done
echo "$@" | grep -q "plenoforge.sif" || exit 1
export APPTAINER_CONTAINER=plenoforge.sif
PATH={image}:/usr/bin:/bin exec bash -c "$command"
"""
PYTHON = """#!/bin/sh
echo "$1" >> {seen}
exec {python} "$@"
"""


def write_program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


@pytest.mark.slow
def test_a_job_in_a_container_runs_with_the_python_of_the_image(tmp_path):
    folder, seen = checkout(tmp_path / "plenoforge"), tmp_path / "seen"
    (folder / "envs/plenoforge.sif").touch()
    write_program(tmp_path / "bin/apptainer", APPTAINER.format(image=tmp_path / "image"))
    python = PYTHON.format(seen=seen, python=sys.executable)
    write_program(tmp_path / "image/python", python)
    path = {"PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}
    run = snakemake(folder, "--sdm", "apptainer", "--", TARGET, env=path)
    assert run.returncode == 0, run.stdout + run.stderr
    assert (folder / TARGET).is_file()
    assert seen.read_text() == "scripts/make_lightfield.py\n"
