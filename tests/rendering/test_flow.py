"""Flow between views: it leads to a point of the same colour, unless rays say that it is hidden.

The scene is the inside of a textured sphere, with a ball in it.
"""

import shutil

import numpy as np
import pytest
from checkouts import checkout, snakemake
from sphere import RADIUS, colour_of, look, write_views

from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.geometry.flow import flow, in_frame
from lightfield.imaging import images
from lightfield.validation.validate import validate

ROW = {"type": "lattice", "cameras": [3, 1, 1], "size": 0.4}
YAML = "{scene: {dataset: published}, flow: {pairs: neighbours}}"

BALL, SIZE = np.array([0.3, 1.5, 0.1]), 0.5
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80, "resolution": [96, 96]},
    "fisheye": {"lens": "equidistant", "fov": 200, "resolution": [96, 96]},
    "panorama": {"lens": "equirectangular", "resolution": [128, 64]},
}
# The camera looks along +Y, at the ball.
TURN = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def camera(x, z):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN, (x, 0, z)
    return matrix


def ball(origin, rays):
    """Return the ball's distance along unit rays (..., 3), inf for rays that miss it."""
    along = rays @ (BALL - origin)
    under = SIZE**2 - np.sum((BALL - origin) ** 2) + along**2
    with np.errstate(invalid="ignore"):
        return np.where((under > 0) & (along > 0), along - np.sqrt(under), np.inf)


@pytest.mark.parametrize("name", LENSES)
def test_flow_leads_to_the_same_point_unless_it_is_hidden(name):
    lens = lenses.from_camera(LENSES[name])
    here, there = camera(-0.2, 0), camera(0.2, 0.1)
    distances = []
    for matrix in (here, there):
        rays = lens.pixel_rays() @ matrix[:3, :3].T
        distances.append(np.fmin(look(lens, matrix)[1], ball(matrix[:3, 3], rays)))
    field, visible = flow(lens, here, there, *distances)
    points = here[:3, 3] + lens.pixel_rays() @ here[:3, :3].T * distances[0][..., None]
    offset = points - there[:3, 3]
    expected = np.linalg.norm(offset, axis=-1)
    to_point = offset / expected[..., None]
    # Rays to the points themselves tell. Points on the ball's own rim are doubtful.
    hidden = ball(there[:3, 3], to_point) < expected - 0.02
    inside = np.isfinite(field[..., 0])
    pixels = np.indices(expected.shape)[::-1].transpose(1, 2, 0) + 0.5 + field
    inside &= ((pixels >= 0) & (pixels < (lens.width, lens.height))).all(axis=-1) | (
        name == "panorama"
    )
    assert hidden[inside].sum() > 20 and not visible[~inside].any()
    assert (visible[inside] == ~hidden[inside]).mean() > 0.98
    # The warped colour equals that of the point here, up to the rounding of a pixel.
    rays = lens.rays(*np.moveaxis(pixels, -1, 0)) @ there[:3, :3].T
    seen = inside & ~hidden
    error = np.linalg.norm(np.cross(rays, to_point), axis=-1)[seen]
    assert error.max() < 1e-6
    wall = seen & (np.linalg.norm(points, axis=-1) > RADIUS - 0.01)
    assert np.ptp(colour_of(points[wall])) > 50


@pytest.mark.parametrize("longitude", [[-180, 180], [-60, 60]])
def test_rounding_does_not_lead_out_of_a_panorama(longitude):
    lens = lenses.from_camera(
        {"lens": "equirectangular", "longitude": longitude, "resolution": [8, 4]}
    )
    motion = np.zeros((2, 4, 8), np.float32)
    # To the very edges, but for rounding.
    motion[0, :, 0] = np.nextafter(np.float32(-0.5), np.float32(-1))
    motion[0, :, -1] = np.nextafter(np.float32(0.5), np.float32(1))
    assert in_frame(lens, motion).all()
    motion[0, :, -1] = 1
    leads_around = longitude == [-180, 180]
    assert in_frame(lens, motion)[:, -1].all() == leads_around


def test_a_neighbour_is_the_nearest_view_elsewhere_with_the_most_similar_direction():
    lens = lenses.from_camera(LENSES["perspective"] | {"fov": 90})
    lightfield = LightField.from_rig(ROW, lens).with_flow()
    assert [view.flow for view in lightfield.views] == [
        "view_0000f_to_view_0001f",
        "view_0001f_to_view_0000f",
        "view_0002f_to_view_0001f",
    ]
    faces = LightField.from_rig(ROW | {"cube_map": True}, lens).with_flow()
    assert faces.views[1].others["flow"] == faces.views[1].name.replace("0000f", "0001f")
    with pytest.raises(UserError, match="flow: all views are from one place"):
        LightField.from_rig(ROW | {"cameras": [1, 1, 1], "cube_map": True}, lens).with_flow()


@pytest.fixture
def folder(tmp_path):
    """A checkout with existing views, whose YAML asks for flow."""
    folder = checkout(tmp_path / "plenoforge", theirs=YAML)
    write_views(folder / "published/dataset", LENSES["perspective"] | {"resolution": [48, 48]}, ROW)
    (folder / "published/dataset").rename(folder / "published/row")
    return folder


@pytest.mark.slow
def test_flow_belongs_to_the_dataset_only_while_the_yaml_asks_for_it(folder):
    def build(target):
        made = snakemake(folder, target, "--config", "scenes=theirs", "preset=full")
        assert made.returncode == 0, made.stdout + made.stderr

    build("all")
    dataset = folder / "results/theirs/row"
    validation = "results/theirs/row/validation.json"
    files = sorted((dataset / "flow").iterdir())
    assert files[0].name == "view_0000f_to_view_0001f.exr" and len(files) == 3
    assert "flow/view_0000f_to_view_0001f.exr" in (dataset / "sha256sums.txt").read_text()
    assert "flow" in (dataset / "lightfield.json").read_text()
    channels = images.read_image(files[0]).channels
    assert {name: str(plane.dtype) for name, plane in channels.items()} == dict.fromkeys(
        "XYV", "float32"
    )
    check_warp(dataset, channels)
    # A missing file alone is computed again, to the same bytes.
    made, kept = files[1].read_bytes(), files[0].stat().st_mtime_ns
    files[1].unlink()
    build(validation)
    assert (files[1].read_bytes(), files[0].stat().st_mtime_ns) == (made, kept)
    # Removed from the YAML, flow is no part of the dataset.
    (folder / "configs/scenes/theirs.yaml").write_text("scene: {dataset: published}")
    build(validation)
    assert not (dataset / "flow").exists()
    assert "flow" not in (dataset / "lightfield.json").read_text()
    assert len(list((folder / "work/removed").rglob("flow/*.exr"))) == 3


def check_warp(dataset, flow):
    """Check that the other view's colour, interpolated bilinearly, equals this one's."""
    views = [images.read_image(dataset / "exr" / f"view_000{n}f.exr").colour for n in (0, 1)]
    rows, columns = np.nonzero(flow["V"] == 1)
    x = columns + flow["X"][rows, columns]
    y = rows + flow["Y"][rows, columns]
    j, i = np.floor(x).astype(int).clip(0, 46), np.floor(y).astype(int).clip(0, 46)
    fx, fy = (x - j)[:, None], (y - i)[:, None]
    top = views[1][i, j] * (1 - fx) + views[1][i, j + 1] * fx
    bottom = views[1][i + 1, j] * (1 - fx) + views[1][i + 1, j + 1] * fx
    error = np.abs(top * (1 - fy) + bottom * fy - views[0][rows, columns])
    assert len(rows) > 1000
    assert np.median(error) < 1e-3


@pytest.mark.parametrize("rig", [ROW, {"type": "cuboid", "cameras": [1, 1, 1], "size": 0.5}])
@pytest.mark.parametrize("name", LENSES)
def test_flow_of_every_lens_agrees_with_the_depth_of_both_views(name, rig, tmp_path, run_program):
    folder = tmp_path / "dataset"
    write_views(folder, LENSES[name] | {"resolution": [48, 24 if name == "panorama" else 48]}, rig)
    LightField.read(folder / "lightfield.json").with_flow().write(folder / "lightfield.json")
    run_program("flow.py", "--lightfield", folder / "lightfield.json", "--output", folder / "flow")
    assert flow_check(folder).passed


SPOILED = {
    "missing": (None, "is missing"),
    "mask": ({"V": 0.5}, "2304 values of V are neither 0 nor 1"),
    "frame": ({"X": 100.0}, "visible points are out of the frame"),
    "number": ({"Y": np.nan}, "2304 values are not finite"),
}


@pytest.fixture(scope="module")
def computed(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("flow") / "dataset"
    write_views(folder, LENSES["fisheye"] | {"resolution": [48, 48]}, ROW)
    LightField.read(folder / "lightfield.json").with_flow().write(folder / "lightfield.json")
    run_program("flow.py", "--lightfield", folder / "lightfield.json", "--output", folder / "flow")
    assert flow_check(folder).passed
    return folder


@pytest.mark.parametrize("what", SPOILED)
def test_validation_checks_flow(what, computed, tmp_path):
    folder = shutil.copytree(computed, tmp_path / "dataset")
    path = folder / "flow/view_0000f_to_view_0001f.exr"
    wrong, problem = SPOILED[what]
    if wrong is None:
        path.unlink()
    else:
        channels = dict(images.read_image(path).channels)
        planes = {name: np.full((48, 48), value, np.float32) for name, value in wrong.items()}
        images.write_exr(path, channels | planes)
    (said,) = flow_check(folder).problems
    assert said.startswith("flow/view_0000f_to_view_0001f.exr: ") and problem in said


WRONG_FLOW = {
    "negated": (lambda c: {**c, "X": -c["X"], "Y": -c["Y"]}, "not where their depth puts them"),
    "axes swapped": (lambda c: {**c, "X": c["Y"], "Y": c["X"]}, "not where their depth puts them"),
    "mirrored": (lambda c: {k: np.fliplr(v) for k, v in c.items()}, "not where their depth"),
    "a tenth of a pixel off": (
        lambda c: {**c, "X": c["X"] + np.float32(0.1) * (c["V"] == 1)},
        "not where their depth puts them",
    ),
    "mask the other way round": (lambda c: {**c, "V": 1 - c["V"]}, ""),
    "all hidden": (lambda c: {**c, "V": 0 * c["V"]}, "values of V are not what the depth"),
}


@pytest.mark.parametrize("what", WRONG_FLOW)
def test_flow_that_contradicts_the_depth_of_both_views_is_named(what, computed, tmp_path):
    folder = shutil.copytree(computed, tmp_path / "dataset")
    path = folder / "flow/view_0000f_to_view_0001f.exr"
    change, problem = WRONG_FLOW[what]
    images.write_exr(path, change(dict(images.read_image(path).channels)))
    (said,) = flow_check(folder).problems
    assert said.startswith("flow/view_0000f_to_view_0001f.exr: ") and problem in said


@pytest.mark.parametrize("changed", ["view_0000f", "view_0001f"])
def test_flow_follows_a_change_of_either_view(changed, computed, tmp_path, run_program):
    folder = shutil.copytree(computed, tmp_path / "dataset")
    path = folder / f"exr/{changed}.exr"
    image = images.read_image(path)
    channels = dict(image.channels) | {"Z": image.channels["Z"] * np.float32(0.9)}
    images.write_exr(path, channels, image.attributes)
    arguments = ("--lightfield", folder / "lightfield.json", "--output", folder / "flow")
    run_program("flow.py", *arguments)
    name = "flow/view_0000f_to_view_0001f.exr"
    assert (folder / name).read_bytes() != (computed / name).read_bytes()
    kept = "flow/view_0002f_to_view_0001f.exr"
    is_same = (folder / kept).read_bytes() == (computed / kept).read_bytes()
    assert is_same == (changed == "view_0000f")


def flow_check(folder):
    return next(check for check in validate(folder).checks if check.name == "passes")


def test_flow_without_depth_is_refused():
    rig = {"type": "lattice", "cameras": [2, 1, 1], "camera": LENSES["fisheye"]}
    content = {"scene": {"builder": "room"}, "rigs": {"one": rig}, "flow": {"pairs": "neighbours"}}
    with pytest.raises(ValueError, match=r"flow: follows from depth, but"):
        Scene.model_validate(content | {"render": {"samples": 1, "depth": "none"}})
    Scene.model_validate(content | {"render": {"samples": 1}})
