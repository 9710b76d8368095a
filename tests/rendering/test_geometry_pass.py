"""The geometry pass: the first surface at each pixel's centre, in scenes with known surfaces."""

import json

import numpy as np
import pytest
from conftest import BLENDER

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80, "resolution": [64, 64]},
    "fisheye_180": {"lens": "equidistant", "fov": 180, "resolution": [64, 64]},
    "fisheye_220": {"lens": "equidistant", "fov": 220, "resolution": [64, 64]},
    "panorama": {"lens": "equirectangular", "resolution": [64, 32]},
}
FOGS = ["mesh_fog", "clear_surface_fog", "volume_object", "nodes_fog", "world_fog"]
# The sphere of `known_surfaces` in geometry_views.py.
SPHERE, RADIUS = np.array([-1, 1.5, 1.25]), 1.0
RENDER = {"samples": 4, "adaptive_threshold": 0, "denoise": False, "seed": 0, "max_bounces": 2}
TURNED = {"center": [0.2, -0.4, 1.1], "rotation": [8, -5, 12]}
AHEAD = {"center": [0, 0, 0]}


def lightfield(camera, place, frame=1, depth=None, **more):
    lens = lenses.from_camera(camera)
    rig = {"type": "lattice", "cameras": [1, 1, 1], **place}
    depth = depth or ("z" if lens.has_z_depth else "distance")
    render = RENDER | {"depth_precision": "float"} | more
    return LightField.from_rig(rig, lens, depth=depth, frame=frame, render=render)


CASES = {
    **{name: ("known_surfaces", lightfield(camera, TURNED)) for name, camera in LENSES.items()},
    **{fog: (fog, lightfield(LENSES["fisheye_180"], TURNED)) for fog in FOGS},
    "moving": ("moving", lightfield(LENSES["fisheye_180"], TURNED, frame=2)),
    "unfocused": ("unfocused", lightfield(LENSES["perspective"], TURNED, depth_of_field=True)),
    "curtains": (
        "curtains",
        lightfield(LENSES["perspective"] | {"fov": 105}, AHEAD, depth="distance"),
    ),
}


@pytest.fixture(scope="module")
def views(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("geometry")
    cases = folder / "cases.json"
    cases.write_text(json.dumps({n: (s, content.to_json()) for n, (s, content) in CASES.items()}))
    run_program(BLENDER / "geometry_views.py", folder, cases)
    return dict(np.load(folder / "views.npz"))


def truth(content):
    """Return the exact distances (h, w), normals (h, w, 3) and surfaces (h, w), 0 for none."""
    view = content.views[0]
    rays = content.lens.pixel_rays() @ view.world_from_camera[:3, :3].T
    origin = view.position
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf)
        wall = np.where(rays[..., 1] > 0, (3 - origin[1]) / rays[..., 1], np.inf)
        along = rays @ (SPHERE - origin)
        under = RADIUS**2 - np.sum((SPHERE - origin) ** 2) + along**2
        sphere = np.where((under > 0) & (along > 0), along - np.sqrt(under), np.inf)
    distances = np.stack([np.full_like(floor, np.inf), floor, wall, sphere])
    # The planes end 10 m from the world's origin.
    points = origin + rays * distances[1:3, ..., None]
    with np.errstate(invalid="ignore"):
        distances[1:3][~(np.abs(points) < 10).all(axis=-1)] = np.inf
    surfaces = np.where(np.isfinite(distances).any(axis=0), distances.argmin(axis=0), 0)
    distance = distances.min(axis=0)
    normals = np.zeros_like(rays)
    normals[surfaces == 1], normals[surfaces == 2] = (0, 0, 1), (0, -1, 0)
    on = surfaces == 3
    normals[on] = (origin + rays[on] * distance[on, None] - SPHERE) / RADIUS
    return distance, normals, surfaces


def inside(surfaces):
    """Return the pixels (h, w) that see the same surface as their eight neighbours."""
    padded = np.pad(surfaces, 1, mode="edge")
    height, width = surfaces.shape
    around = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return (np.stack(around) == surfaces).all(axis=0) & (surfaces > 0)


def shown(views, name, kind, pixels):
    """Return the names of the objects or materials that some ``pixels`` (h, w) show."""
    numbers = np.unique(views[f"{name}.{kind}s"][pixels])
    return views[f"{name}.{kind}_names"][numbers - 1].tolist()


def stored(content, distance):
    """Return distances as a dataset holds them."""
    if content.depth == "distance":
        return distance
    return distance * -content.lens.pixel_rays()[..., 2]


@pytest.mark.parametrize("name", [*LENSES, *FOGS, "moving", "unfocused"])
def test_depth_and_normals_are_those_of_the_first_surface(name, views):
    content = CASES[name][1]
    distance, normals, surfaces = truth(content)
    sure = inside(surfaces)
    assert sure.mean() > 0.3 and (surfaces[sure] == 3).sum() > 30
    for surface, material in enumerate(["floor", "wall", "sphere"], 1):
        pixels = sure & (surfaces == surface)
        assert shown(views, name, "object", pixels) == [
            ["Plane", "Plane.001", "Plane.002"][surface - 1]
        ]
        assert shown(views, name, "material", pixels) == [material]
    # A ray's direction is exact to a few units of the 24th bit. At a grazing angle, that moves the
    # point on the surface accordingly farther.
    rays = content.lens.pixel_rays() @ content.views[0].world_from_camera[:3, :3].T
    facing = np.abs(np.sum(rays * normals, axis=-1))
    z, expected_z = views[f"{name}.z"][sure], stored(content, distance)[sure]
    error = np.abs(z.astype(np.float64) / expected_z - 1)
    assert np.median(error) < 1e-6
    assert (error * facing[sure]).max() < 1.5e-6
    turned = np.linalg.norm(views[f"{name}.normal"] - normals, axis=-1)[sure]
    assert turned.max() < 1e-5


@pytest.mark.parametrize("name", [*LENSES, *FOGS])
def test_depth_misses_exactly_where_there_is_no_surface(name, views):
    content = CASES[name][1]
    distance, _, surfaces = truth(content)
    around = inside(surfaces + 1)
    z = views[f"{name}.z"]
    np.testing.assert_array_equal(np.isposinf(z)[around], np.isposinf(distance)[around])
    assert not np.isnan(z).any()
    for empty in ("normal", "objects", "materials"):
        assert not views[f"{name}.{empty}"][np.isposinf(z)].any()


@pytest.mark.parametrize("name", CASES)
def test_geometry_does_not_change_the_colour(name, views):
    colour = views[f"{name}.colour"]
    assert np.ptp(colour) > 0.1
    np.testing.assert_array_equal(colour, views[f"{name}.alone"])


def test_invisible_surfaces_have_no_depth_and_glass_has(views):
    content = CASES["curtains"][1]
    rays = content.lens.pixel_rays() @ content.views[0].world_from_camera[:3, :3].T
    x, z = (2 * rays[..., axis] / rays[..., 1] for axis in (0, 2))
    for number, (curtain, normal) in enumerate(
        [("Plane", (np.sin(0.3), -np.cos(0.3), 0))]
        + [(f"Plane.00{1 + n}", (0, -1, 0)) for n in (1, 2, 3, 4)]
    ):
        inside_card = (np.abs(x - (number - 2)) < 0.4) & (np.abs(z) < 0.4)
        assert inside_card.sum() > 80
        assert shown(views, "curtains", "object", inside_card) == [curtain]
        np.testing.assert_allclose(
            views["curtains.normal"][inside_card],
            np.broadcast_to(normal, (inside_card.sum(), 3)),
            atol=1e-6,
        )
        if curtain != "Plane":
            np.testing.assert_allclose(
                views["curtains.z"][inside_card], 2 / rays[..., 1][inside_card], rtol=1e-6
            )
