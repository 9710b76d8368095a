"""Extreme renders: none is wrong without a warning, and the check of cameras gives the warning."""

import csv
from pathlib import Path

import pytest

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

ROOT = Path(__file__).parents[2]
# Builds a scene of benchmarks/extremes.py as a .blend. The case's name chooses it.
BUILD = """
import sys
sys.path.insert(0, sys.argv[1])
import extremes
from pathlib import Path
from lightfield.rendering.scenes import blend_file
case = next(case for case in extremes.cases() if case.name == sys.argv[2])
blend_file.new_scene()
case.build()
blend_file.save_scene(Path(sys.argv[3]))
"""
# At 0 m are objects that no render shows, fog, and a transparent text. At 5 and 10 m are objects
# that no viewport shows.
HIDDEN = """
import sys
from pathlib import Path
import bpy
from lightfield.rendering.scenes import blend_file
blend_file.new_scene()
clear, fog = (bpy.data.materials.new(name) for name in ("clear", "fog"))
clear.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.5
nodes = fog.node_tree.nodes
nodes.remove(nodes["Principled BSDF"])
link = fog.node_tree.links.new
link(nodes.new("ShaderNodeVolumeScatter").outputs[0], nodes["Material Output"].inputs["Volume"])
for name, x in (("cutter", 0), ("off", 0), ("mist", 0), ("statue", 5), ("bust", 10)):
    bpy.ops.mesh.primitive_cube_add(location=(x, 0, 0))
    bpy.context.object.name = name
things = bpy.data.objects
things["cutter"].hide_render = True
things["mist"].data.materials.append(fog)
things["statue"].hide_viewport = True
things["bust"].hide_set(True)
collection = bpy.data.collections.new("off")
bpy.context.scene.collection.children.link(collection)
bpy.context.scene.collection.objects.unlink(things["off"])
collection.objects.link(things["off"])
collection.hide_render = True
bpy.ops.object.text_add(location=(0, 0.6, 0))
bpy.context.object.data.extrude = 1
bpy.context.object.data.materials.append(clear)
blend_file.save_scene(Path(sys.argv[1]))
"""
# Measures one case with another case's truth.
UNTRUE = """
import dataclasses, sys
sys.path.insert(0, sys.argv[1])
import extremes
from lightfield.core.cli import run
case = next(case for case in extremes.cases() if case.name == "light of 65000")
wrong = dataclasses.replace(case, truth=extremes.of_wall(10, 64000))
extremes.cases = lambda: [case, wrong]
sys.argv[1:] = ["--output", sys.argv[2]]
run(extremes.main)
"""


def test_no_case_is_wrong_without_a_warning(tmp_path, run_program):
    run_program(ROOT / "benchmarks/extremes.py", "--output", tmp_path)
    with (tmp_path / "extremes.csv").open() as file:
        rows = {row["case"]: row for row in csv.DictReader(file)}
    rows_of_verdict = {kind: [] for kind in ("right", "warned", "refused", "as asked")}
    for name, row in rows.items():
        rows_of_verdict[row["verdict"]].append(name)
    assert len(rows_of_verdict["right"]) >= 25
    assert rows_of_verdict["warned"] == [
        *(f"a room of 4 m, 1e{power} m from the origin" for power in (5, 6, 7)),
        "light of 1e+06",
        "1,000 transparent layers, of 8 that may be",
        "a sun of 0° through glass, filter glossy 0, clamped at 0",
    ]
    assert rows_of_verdict["refused"] == [
        "a room of 1 mm",
        "a surface 0.0001 m ahead",
        "a surface 5e-05 m ahead",
    ]
    assert all(
        rows[name]["said"] for kind in ("warned", "refused") for name in rows_of_verdict[kind]
    )
    assert len(rows_of_verdict["as asked"]) == 2
    assert (tmp_path / "extremes.md").read_text().count("\n") == len(rows) + 2


def test_a_wrong_case_fails_the_run(tmp_path, run_program):
    program = tmp_path / "untrue.py"
    program.write_text(UNTRUE)
    result = run_program(program, ROOT / "benchmarks", tmp_path, check=False)
    assert result.returncode == 1
    assert "error: 1 of 2 cases are wrong without a warning: light of 65000" in result.stderr


def checked(folder, run_program, blend, **rig):
    """Run the check of cameras on a lattice of them."""
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [32, 16]})
    content = LightField.from_rig({"type": "lattice", **rig}, lens, depth="distance", frame=1)
    content.write(folder / "lightfield.json")
    return run_program(
        "check_cameras.py",
        "--blend",
        blend,
        "--lightfield",
        folder / "lightfield.json",
        "--output",
        folder / "cameras.json",
        check=False,
    )


@pytest.mark.parametrize(
    ("case", "place", "said"),
    [
        ("a room of 4 m, 1e6 m from the origin", [1e6, -1e6, 1e6], "6.2 cm apart"),
        ("1,000 transparent layers, of 8 that may be", [0, 0, 0], "more than 8 transparent"),
        ("8 transparent layers, of 8 that may be", [0, 0, 0], None),
        ("light of 65000", [0, 0, 0], None),
    ],
)
def test_the_check_of_cameras_warns(tmp_path, run_program, case, place, said):
    program, blend = tmp_path / "build.py", tmp_path / "scene.blend"
    program.write_text(BUILD)
    run_program(program, ROOT / "benchmarks", case, blend)
    result = checked(tmp_path, run_program, blend, cameras=[1, 1, 1], center=place)
    warnings = [line for line in result.stderr.splitlines() if line.startswith("warning: ")]
    assert len(warnings) == (said is not None)
    assert said is None or said in warnings[0]


def test_the_check_of_cameras_sees_exactly_what_a_render_shows(tmp_path, run_program):
    program, blend = tmp_path / "build.py", tmp_path / "scene.blend"
    program.write_text(HIDDEN)
    run_program(program, blend)
    result = checked(tmp_path, run_program, blend, cameras=[3, 1, 1], size=10, center=[5, 0, 0])
    assert "2 of 3 cameras are inside bust, statue: view_0001f, view_0002f;" in result.stderr
    result = checked(tmp_path, run_program, blend, cameras=[1, 1, 1])
    assert (result.returncode, result.stderr) == (0, "")
