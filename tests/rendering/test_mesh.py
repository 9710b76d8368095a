"""The surface as meshes: what cameras see, with names, boxes and numbers, and nothing else."""

import json

import numpy as np
import pytest
import trimesh
from conftest import BLENDER
from oracles import readers
from scipy import ndimage

from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.products import exports

FRAME = 2
RENDER = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0, "max_bounces": 0}
LENS = {"lens": "rectilinear", "fov": 60, "resolution": [80, 60]}
RIG = {"type": "lattice", "cameras": [2, 1, 1], "size": 0.6, "center": [0, 0, 0.4]}


@pytest.fixture(scope="module")
def scene(tmp_path_factory, run_program):
    """A folder with scene.blend, its meshes in mesh/, and two views with ids in exr/."""
    folder = tmp_path_factory.mktemp("mesh")
    run_program(BLENDER / "mesh_scene.py", folder)
    lightfield = LightField.from_rig(
        RIG,
        lenses.from_camera(LENS),
        depth="distance",
        frame=FRAME,
        scene={"fingerprint": "0"},
        render={**RENDER, "depth_precision": "float", "passes": ["object", "instance"]},
    )
    lightfield.write(folder / "lightfield.json")
    blend = ("--blend", folder / "scene.blend")
    arguments = ("--lightfield", folder / "lightfield.json", "--output", folder / "exr")
    run_program("render_shard.py", *blend, *arguments, "--threads", "1")
    write_mesh(run_program, folder, folder / "mesh")
    return folder


def write_mesh(run_program, folder, output, **settings):
    file = output.with_suffix(".json")
    file.write_text(json.dumps({"frame": FRAME, "numbered": True, **settings}))
    blend = ("--blend", folder / "scene.blend")
    return run_program("surface.py", *blend, "--settings", file, "--output", output)


def read_ply(path):
    """Return the corners (n, 3, 3) of all triangles, and the object (n,) of each."""
    mesh = trimesh.load_mesh(path, process=False)
    owners = mesh.metadata["_ply_raw"]["face"]["data"]["object"]
    assert len(owners) == len(mesh.faces)
    return mesh.triangles.astype(np.float64), owners


def read_glb(path):
    """Return the triangles (n, 3, 3) of each node in the GLB's world, by the node's name."""
    scene = trimesh.load_scene(path, process=False)
    triangles = {}
    for name in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[name]
        # It turns the faces where a matrix mirrors, as glTF 2.0, 3.7.4 demands.
        mesh = scene.geometry[geometry].copy().apply_transform(matrix)
        triangles[name] = mesh.triangles
    return triangles


def first_hits(triangles, origin, rays):
    """Return the distance (n,) to the first triangle on each ray, and its index (n,).

    Rays (n, 3) have unit length. Where nothing is hit, the distance is inf. By Möller and Trumbore,
    Fast, Minimum Storage Ray/Triangle Intersection.
    """
    nearest = np.full(len(rays), np.inf)
    index = np.zeros(len(rays), int)
    for number, (a, b, c) in enumerate(triangles):
        p = np.cross(rays, c - a)
        determinant = p @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = p @ (origin - a) / determinant
            q = np.cross(origin - a, b - a)
            v = rays @ q / determinant
            distance = (c - a) @ q / determinant
            is_hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0) & (distance < nearest)
        nearest[is_hit] = distance[is_hit]
        index[is_hit] = number
    return nearest, index


def objects_of(folder):
    return json.loads((folder / "mesh/objects.json").read_text())


def views(folder):
    """Yield the world rays (n, 3), the depth (n,) and the instances (n,) of each view."""
    lightfield = LightField.read(folder / "lightfield.json")
    for view in lightfield.views:
        rays = lightfield.lens.pixel_rays().reshape(-1, 3) @ view.world_from_camera[:3, :3].T
        depth = images.read_image(folder / f"exr/{view.name}.exr").channels["Z"].ravel()
        numbers = images.read_image(folder / f"instance/{view.name}.exr").channels["Y"].ravel()
        yield view.position, rays, depth.astype(np.float64), numbers


def test_every_pixels_ray_meets_the_mesh_where_cycles_does_on_the_same_object(scene):
    triangles, owners = read_ply(scene / "mesh/scene.ply")
    entries = objects_of(scene)["objects"]
    numbers = np.array([entry["instance"] for entry in entries])
    for position, rays, depth, instances in views(scene):
        distance, index = first_hits(triangles, position, rays)
        hits = np.isfinite(depth)
        assert 0.3 < hits.mean() < 0.8
        # A ray that grazes an edge may miss it.
        is_equal = np.isclose(distance, depth, rtol=2e-5) | (~hits & np.isinf(distance))
        assert (~is_equal).mean() < 2e-3
        compared = hits & is_equal
        assert (numbers[owners[index]] == instances)[compared].mean() > 0.999


def test_objects_and_instances_keep_their_names_and_the_unseen_are_not_there(scene):
    names = {entry["name"] for entry in objects_of(scene)["objects"]}
    originals = {entry["original"] for entry in objects_of(scene)["objects"]}
    expected = {"floor", "smooth", "row", "moving", "prop", "other prop", "sheared", "text"}
    assert originals == expected | {"ring", "drop", "stone", "furry"}
    assert {"text", "ring", "drop"} <= names
    assert len([name for name in names if " > prop " in name]) == 2
    assert len([name for name in names if " > stone " in name]) == 4
    assert names == read_glb(scene / "mesh/scene.glb").keys()


def test_what_cannot_be_a_mesh_is_named_with_the_reason(scene):
    left_out = objects_of(scene)["left_out"]
    assert left_out.keys() == {"fog", "smoke", "strands", "dust", "furry"}
    assert "volume" in left_out["fog"]
    assert "volume" in left_out["smoke"]
    assert "hair" in left_out["furry"]


def test_a_glb_has_the_triangles_of_the_ply_with_y_up(scene):
    triangles, owners = read_ply(scene / "mesh/scene.ply")
    in_glb = read_glb(scene / "mesh/scene.glb")
    for number, entry in enumerate(objects_of(scene)["objects"]):
        x, y, z = np.moveaxis(triangles[owners == number], -1, 0)
        expected = np.stack([x, z, -y], axis=-1)
        assert np.allclose(volumes(in_glb[entry["name"]]), volumes(expected), atol=1e-5)
        actual = in_glb[entry["name"]]
        assert np.allclose(actual.reshape(-1, 3).min(0), expected.reshape(-1, 3).min(0), atol=1e-5)
        assert np.allclose(actual.reshape(-1, 3).max(0), expected.reshape(-1, 3).max(0), atol=1e-5)


def volumes(triangles):
    """Return the signed volume that triangles enclose. An inverted mesh has the opposite sign."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_faces_look_outwards_also_where_a_matrix_mirrors_or_shears(scene):
    triangles, owners = read_ply(scene / "mesh/scene.ply")
    in_glb = read_glb(scene / "mesh/scene.glb")
    mirrored = set()
    for number, entry in enumerate(objects_of(scene)["objects"]):
        if entry["original"] == "floor":
            continue  # A plane encloses nothing.
        assert volumes(triangles[owners == number]) > 0
        assert volumes(in_glb[entry["name"]]) > 0
        if np.linalg.det(entry["matrix"]) < 0:
            mirrored.add(entry["original"])
    assert mirrored == {"prop", "other prop", "sheared"}


def test_a_box_is_the_tightest_along_its_axes_and_holds_what_the_views_show(scene):
    triangles, owners = read_ply(scene / "mesh/scene.ply")
    entries = objects_of(scene)["objects"]
    for number, entry in enumerate(entries):
        box = {key: np.array(value) for key, value in entry["box"].items()}
        assert np.allclose(box["rotation"] @ box["rotation"].T, np.eye(3), atol=1e-6)
        assert np.linalg.det(box["rotation"]) > 0
        points = triangles[owners == number].reshape(-1, 3)
        local = (points - box["center"]) @ box["rotation"]
        assert np.allclose(local.max(axis=0), box["size"] / 2, atol=1e-5)
        assert np.allclose(local.min(axis=0), -box["size"] / 2, atol=1e-5)
    by_number = {entry["instance"]: entry["box"] for entry in entries}
    for position, rays, depth, instances in views(scene):
        for number in np.unique(instances[np.isfinite(depth)]):
            box = by_number[number]
            seen = instances == number
            points = position + rays[seen] * depth[seen, None]
            local = (points - box["center"]) @ np.array(box["rotation"])
            assert (np.abs(local) < np.array(box["size"]) / 2 + 1e-3).all()


def test_an_object_has_its_pose_at_the_frame(scene, run_program, tmp_path):
    moving = {entry["name"]: entry for entry in objects_of(scene)["objects"]}["moving"]
    assert np.allclose(np.array(moving["matrix"])[:3, 3], (-0.4, 6, -0.5))
    write_mesh(run_program, scene, tmp_path / "first", frame=1, formats=["glb"])
    content = json.loads((tmp_path / "first/objects.json").read_text())
    earlier = {entry["name"]: entry for entry in content["objects"]}["moving"]
    assert content["frame"] == 1
    assert np.allclose(np.array(earlier["matrix"])[:3, 3], (0, 3, 5))
    assert not (tmp_path / "first/scene.ply").exists()


def test_equal_scenes_give_equal_bytes(scene, run_program, tmp_path):
    write_mesh(run_program, scene, tmp_path / "again")
    for name in ("scene.glb", "scene.ply", "objects.json", "export.json"):
        assert (tmp_path / "again" / name).read_bytes() == (scene / "mesh" / name).read_bytes()


def test_the_oracle_finds_a_moved_object(scene, tmp_path):
    size = tuple(LENS["resolution"])
    assert not readers.read(scene / "mesh/export.json", size).faults
    for path in (scene / "mesh").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    content = json.loads((tmp_path / "objects.json").read_text())
    floor = next(entry for entry in content["objects"] if entry["name"] == "floor")
    floor["matrix"][2][3] = -2
    floor["box"]["size"][0] = 1
    (tmp_path / "objects.json").write_text(json.dumps(content))
    moved, smaller = readers.read(tmp_path / "export.json", size).faults
    assert "scene.glb: floor: matrix" in moved
    assert "scene.ply: x: is not within" in smaller


def test_coco_has_the_box_of_each_object_and_instance_in_each_view(scene, tmp_path):
    settings = EXPORTERS["coco"](sources=["views"])
    exports.run(SourceDataset(scene, "", ".exr"), settings, tmp_path)
    content = json.loads((tmp_path / "instances.json").read_text())
    names = {category["id"]: category["name"] for category in content["categories"]}
    boxes = {
        (annotation["image_id"], annotation["instance"]): annotation
        for annotation in content["annotations"]
    }
    assert len(boxes) == len(content["annotations"])
    for image in content["images"]:
        assert [image["width"], image["height"]] == LENS["resolution"]
        numbers = images.read_image(scene / "instance" / image["file_name"]).channels["Y"]
        shown = np.unique(numbers[numbers > 0])
        assert {number for view, number in boxes if view == image["id"]} == set(shown.tolist())
        for number in shown.tolist():
            ((rows, columns),) = ndimage.find_objects((numbers == number).astype(int))
            x, y, width, height = boxes[image["id"], number]["bbox"]
            assert (x, y) == (columns.start, rows.start)
            assert (x + width, y + height) == (columns.stop, rows.stop)
            assert boxes[image["id"], number]["area"] == (numbers == number).sum()
    categories = {a["name"]: names[a["category_id"]] for a in content["annotations"]}
    assert categories["floor"] == "floor"
    assert categories["left > prop 0"] == "prop"
    assert not readers.read(tmp_path / "export.json", tuple(LENS["resolution"])).faults


def test_the_smoke_datasets_depth_lies_on_its_mesh(smoke):
    folder = smoke / "results/smoke/LFCuboid_1x1x1"
    triangles, _ = read_ply(folder / "mesh/scene.ply")
    lightfield = LightField.read(folder / "lightfield.json")
    view = lightfield.views[0]
    rays = lightfield.lens.pixel_rays().reshape(-1, 3)
    z = images.read_image(folder / f"exr/{view.name}.exr").channels["Z"].ravel()
    seen = np.isfinite(z) & (rays[:, 2] < -0.1)
    distance, _ = first_hits(
        triangles, view.position, rays[seen] @ view.world_from_camera[:3, :3].T
    )
    # A ray that grazes an edge may miss it.
    is_equal = np.isclose(distance, z[seen] / -rays[seen, 2], rtol=1e-4)
    assert seen.sum() > 1000
    assert is_equal.mean() > 0.998
