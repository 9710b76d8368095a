"""Pairs of views for DUSt3R: points and colours of a scene in closed form, and its overlaps."""

import cv2
import numpy as np
import OpenEXR
import pytest
from sphere import LENSES, colour_of, write_views
from test_exports import exported, on_sphere

from lightfield.core.errors import UserError

RIG = {"type": "plane", "cameras": [3, 2], "size": 1.2, "center": [0.3, -0.2, 0.1]}


def opened(folder):
    """Return the list of pairs as DUSt3R's loader reads it."""
    with np.load(folder / "waymo_pairs.npz") as data:
        return dict(data)


def points_of(path):
    """Return the world points (h, w, 3) of a view, as DUSt3R lifts them from its depth."""
    (part,) = OpenEXR.File(str(path.with_suffix(".exr"))).parts
    depth = part.channels["Y"].pixels
    with np.load(path.with_suffix(".npz")) as data:
        camera, matrix = data["intrinsics"], data["cam2world"]
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    local = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera).T
    return local * depth[..., None] @ matrix[:3, :3].T + matrix[:3, 3]


def share(first, second):
    """Return the share of a view's pixels that lie in another one's frame. Nothing hides them."""
    points = points_of(first)
    with np.load(second.with_suffix(".npz")) as data:
        camera, matrix = data["intrinsics"], data["cam2world"]
    local = (points - matrix[:3, 3]) @ matrix[:3, :3]
    pixels = local @ camera.T
    pixels = np.rint(pixels[..., :2] / pixels[..., 2:])
    in_frame = (pixels >= 0) & (pixels < points.shape[1::-1])
    return (in_frame.all(axis=-1) & (local[..., 2] > 0)).mean()


@pytest.mark.parametrize("lens", ["perspective", "shifted"])
def test_views_lift_to_points_with_the_colours_of_their_images(tmp_path, lens):
    write_views(tmp_path / "dataset", LENSES[lens], RIG)
    folder = exported(tmp_path / "dataset", "dust3r", "views", tmp_path)
    (scene,) = opened(folder)["scenes"]
    names = opened(folder)["frames"]
    assert len(names) == 6
    for name in names:
        points = points_of(folder / scene / name)
        on_sphere(points, 1e-5)
        picture = cv2.imread(str(folder / scene / f"{name}.jpg"))[..., ::-1]
        np.testing.assert_allclose(picture, colour_of(points), atol=6)


@pytest.mark.parametrize("least", [0.25, 0.8])
def test_pairs_are_the_views_that_see_enough_of_each_other(tmp_path, least):
    write_views(tmp_path / "dataset", LENSES["perspective"], RIG)
    options = {} if least == 0.25 else {"overlap": least}
    folder = exported(tmp_path / "dataset", "dust3r", "views", tmp_path, **options)
    content = opened(folder)
    paths = [folder / "views" / name for name in content["frames"]]
    overlaps = {
        (i, j): min(share(paths[i], paths[j]), share(paths[j], paths[i]))
        for i in range(6)
        for j in range(i + 1, 6)
    }
    assert min(abs(overlap - least) for overlap in overlaps.values()) > 0.005
    expected = [pair for pair, overlap in overlaps.items() if overlap > least]
    assert content["pairs"].tolist() == [[0, *pair] for pair in expected]
    assert len(expected) < len(overlaps) or least == 0.25
    for pair, score in zip(expected, content["scores"], strict=True):
        assert score == pytest.approx(overlaps[pair], abs=0.005)


def test_equal_views_give_equal_bytes(tmp_path, monkeypatch):
    write_views(tmp_path / "dataset", LENSES["perspective"], RIG)
    contents = []
    for zone in ("UTC0", "XYZ-9"):
        monkeypatch.setenv("TZ", zone)
        folder = exported(tmp_path / "dataset", "dust3r", "views", tmp_path / zone)
        contents.append([path.read_bytes() for path in sorted(folder.rglob("*.np*"))])
    assert len(contents[0]) == 7
    assert contents[0] == contents[1]
    # ZIP files have the time of each member, in steps of two seconds.
    assert b"\x00\x00\x21\x00" in contents[0][0][:20]


def test_views_without_overlap_are_refused(tmp_path):
    write_views(tmp_path / "dataset", LENSES["perspective"], RIG)
    message = r"^exports\.dust3r\.overlap: is 0\.99, but no two views have more than 0\.\d\d in"
    with pytest.raises(UserError, match=message):
        exported(tmp_path / "dataset", "dust3r", "views", tmp_path, overlap=0.99)
    assert not (tmp_path / "dust3r").exists()
