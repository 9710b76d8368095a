"""Heads are built: dual fisheyes of 200° back to back, and a stereo pair of different lenses."""

import json

import numpy as np
import pycolmap
import pytest
import tiny
import yaml
from checkouts import checkout, planned, snakemake

from lightfield.reading.opening import open_dataset

pytestmark = pytest.mark.slow
WIDE = {"lens": "equidistant", "fov": 200, "resolution": [32, 32]}
SCENE = {
    "licence": "CC0-1.0",
    "scene": {"builder": "room"},
    "render": {"samples": 1, "passes": ["normal"]},
    "rigs": {
        "dual": {
            "type": "path",
            "count": 2,
            "keys": [
                {"position": [-0.3, 0, 1.3], "rotation": [80, 0, 30]},
                {"position": [0.4, 0.3, 1.4], "rotation": [100, 5, -50]},
            ],
            "head": {
                "front": {"camera": WIDE, "position": [0, 0, -0.02]},
                "back": {"camera": WIDE, "position": [0, 0, 0.02], "rotation": [0, 180, 0]},
            },
        },
        "pair": {
            "type": "plane",
            "cameras": [2, 1],
            "size": 0.4,
            "center": [0, -0.5, 1.3],
            "head": {
                "left": {
                    "camera": {"lens": "rectilinear", "fov": 80, "resolution": [32, 24]},
                    "position": [-0.1, 0, 0],
                },
                "right": {
                    "camera": {"lens": "equidistant", "fov": 160, "resolution": [40, 40]},
                    "position": [0.1, 0.01, 0],
                    "rotation": [1, -3, 0.5],
                },
            },
        },
    },
    "reprojections": {
        "aside": {
            "rigs": ["pair_left", "pair_right"],
            "camera": {"lens": "rectilinear", "fov": 60, "resolution": [16, 16]},
            "rotation": [15, -10, 5],
            "format": "exr",
        }
    },
    "exports": {
        "colmap": {
            "sources": ["views", "aside"],
            "together": ["pair_left", "pair_right"],
            "points": 200,
        },
        "kalibr": {"sources": ["views"], "together": ["pair_left", "pair_right"]},
    },
    "report": {"panorama": False},
}
HEADS = {"dual": ("front", "back"), "pair": ("left", "right")}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = checkout(tmp_path_factory.mktemp("heads") / "heads", tiny=json.dumps(SCENE))
    said = tiny.build(folder)
    rigs = [f"{head}_{camera}" for head, cameras in HEADS.items() for camera in cameras]
    assert all(f"valid: results/tiny/{rig}/report" in said for rig in rigs)
    return folder


def test_one_list_ties_the_frames_of_a_heads_cameras(built):
    scene = built / "results/tiny"
    heads = json.loads((scene / "heads.json").read_text())
    assert {head: (*content["cameras"],) for head, content in heads.items()} == HEADS
    for content in heads.values():
        mounts = {
            name: np.array(camera["body_from_camera"])
            for name, camera in content["cameras"].items()
        }
        datasets = {
            name: open_dataset(scene / camera["rig"]) for name, camera in content["cameras"].items()
        }
        assert [frame["name"] for frame in content["frames"]] == ["view_0000f", "view_0001f"]
        for number, frame in enumerate(content["frames"]):
            for name, file in frame["views"].items():
                view = datasets[name].views[number]
                assert scene / file == view.path
                expected = np.array(frame["world_from_body"]) @ mounts[name]
                np.testing.assert_allclose(view.world_from_camera, expected, rtol=0, atol=5e-12)


def from_tangent_planes(view, other):
    """Return how far what ``other`` sees is from the planes that a view's pixels touch."""
    origins, rays = other.rays()
    points = (origins + rays * other.distance[..., None]).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=-1)]
    pixels, is_visible = view.project(points)
    column, row = np.floor(pixels[is_visible]).astype(int).T
    origins, rays = view.rays()
    touched = (origins + rays * view.distance[..., None])[row, column]
    return np.abs(((points[is_visible] - touched) * view.normal[row, column]).sum(axis=-1))


@pytest.mark.parametrize("head", HEADS)
def test_both_cameras_see_the_same_surfaces(built, head):
    """The back-to-back fisheyes share a band of 20°, and the pair most of the left view."""
    first, second = (
        open_dataset(built / f"results/tiny/{head}_{camera}") for camera in HEADS[head]
    )
    for view, other in zip(first.views, second.views, strict=True):
        distances = from_tangent_planes(view, other)
        distances = distances[np.isfinite(distances)]
        assert len(distances) > 50
        # Half floats and normals of float32 limit a wall's; edges lie on other planes.
        assert np.median(distances) < 1e-3


@pytest.mark.parametrize("source", ["", "aside"])
def test_colmap_reads_the_pair_as_one_rig(built, source):
    scene = built / "results/tiny"
    folder = scene / "pair_left" / source / "exports/colmap"
    model = pycolmap.Reconstruction(folder / "sparse/0")
    cameras = 2
    assert (model.num_rigs(), model.num_cameras(), model.num_frames()) == (1, cameras, 2)
    assert len(model.points3D) > 50
    for camera in HEADS["pair"]:
        dataset = open_dataset(scene / f"pair_{camera}" / source)
        for view in dataset.views:
            image = model.find_image_with_name(f"{camera}/{view.name}.png")
            assert (folder / "images" / image.name).is_file()
            matrix = image.cam_from_world().inverse().matrix() * [1, -1, -1, 1]
            np.testing.assert_allclose(matrix, view.world_from_camera[:3], rtol=0, atol=5e-12)


def test_a_camchain_of_the_pair_is_there(built):
    path = built / "results/tiny/pair_left/exports/kalibr/camchain.yaml"
    chain = yaml.safe_load(path.read_text())
    assert [camera["resolution"] for camera in chain.values()] == [[32, 24], [40, 40]]


def test_a_lost_list_is_made_again(built):
    (built / "results/tiny/heads.json").unlink()
    assert planned(built, *tiny.CHOSEN)["heads"] == 1
    tiny.build(built)
    assert "Nothing to be done" in snakemake(built, "--dry-run", *tiny.CHOSEN).stderr
