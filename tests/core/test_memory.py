"""The memory of a machine and of rendering: measured, and refused in time."""

import json

import pytest

from lightfield.core import memory as machine
from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.planning.cost import DENOISED_PIXEL_MEMORY
from lightfield.rendering.inspection import scene_memory
from lightfield.stages.views import RenderShard


def test_this_machines_memory_is_within_every_limit(tmp_path, monkeypatch):
    available = machine.available()
    assert 0 < machine.peak() < available
    monkeypatch.setattr(machine, "CONTROL_GROUPS", tmp_path)
    monkeypatch.setattr(machine, "OWN_GROUPS", tmp_path / "own")
    assert machine.available() >= available


@pytest.mark.parametrize(
    ("group", "limits"),
    [
        # The second version of control groups: a batch system limits a job, but not its steps.
        (
            "0::/batch/job_7/step_0",
            {"batch/job_7/memory.max": "1000000", "batch/job_7/step_0/memory.max": "max"},
        ),
        ("0::/batch/job_7", {"memory.max": "max", "batch/job_7/memory.max": "1000000"}),
        # The first version: the machine's own limit is a huge number.
        (
            "5:cpu:/batch\n9:memory:/batch/job_7",
            {
                "cpu/batch/memory.max": "1000",
                "memory/memory.limit_in_bytes": "9223372036854771712",
                "memory/batch/memory.limit_in_bytes": "1000000",
                "memory/batch/job_7/memory.limit_in_bytes": "2000000",
            },
        ),
    ],
)
def test_the_tightest_of_nested_memory_limits_counts(group, limits, tmp_path, monkeypatch):
    (tmp_path / "own").write_text(f"{group}\n")
    for name, limit in limits.items():
        path = tmp_path / "groups" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{limit}\n")
    monkeypatch.setattr(machine, "CONTROL_GROUPS", tmp_path / "groups")
    monkeypatch.setattr(machine, "OWN_GROUPS", tmp_path / "own")
    assert machine.available() == 1_000_000


def test_a_scene_is_measured_in_a_process_of_its_own(room):
    measured = scene_memory.measure(room, {"left_out": [], "fullest_frame": 1}, {})
    assert 100e6 < measured < 1e9


def test_a_scene_that_does_not_fit_is_refused_before_it_starts(tmp_path):
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [1000, 1000]})
    rig = {"type": "plane", "cameras": [1, 1]}
    render = {"denoise": True, "seed": 0}
    path = tmp_path / "lightfield.json"
    LightField.from_rig(rig, lens, depth="z", frame=1, render=render).write(path)
    inventory = tmp_path / "inventory.json"
    inventory.write_text(json.dumps({"memory_bytes": machine.available(), "left_out": []}))
    needed = machine.available() + 1000 * 1000 * DENOISED_PIXEL_MEMORY
    message = rf"a\.blend: a view of 1000 × 1000 pixels takes {units.size(needed)} of memory"
    with pytest.raises(UserError, match=message):
        RenderShard(
            blend=tmp_path / "a.blend",
            lightfield=path,
            inventory=inventory,
            output=tmp_path / "exr",
            device="cpu",
            threads=1,
        ).run()
    assert not (tmp_path / "exr").exists()
