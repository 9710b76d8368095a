"""The export for instant-ngp, read back as its loader reads it (nerf_loader.cu), in float32."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest
from pydantic import TypeAdapter, ValidationError
from sphere import CALIBRATED, look_at_ball, write_views

from lightfield.core.errors import UserError
from lightfield.engine.flags import parsed
from lightfield.export.source import SourceDataset
from lightfield.exporters import instant_ngp
from lightfield.exporters.base import ExportSettings
from lightfield.exporters.instant_ngp import InstantNgp, TransformsByHand
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import lenses
from lightfield.geometry.depth import in_16_bits
from lightfield.imaging import images
from lightfield.products import exports

RIG: dict[str, Any] = {
    "type": "cylinder",
    "cameras": [3, 2],
    "size": [1.5, 1.5, 1],
    "center": [0.4, -0.7, 1.2],
    "rotation": [15, -25, 40],
    "split": "odd",
}
PERSPECTIVE = {
    "lens": "rectilinear",
    "resolution": [64, 48],
    "focal_length": 20,
    "sensor_size": [36, 30],
    "principal_point": [29.5, 26.25],
}
FISHEYE = {"lens": "equidistant", "resolution": [64, 64], "fov": 180}
WIDE = {"lens": "equidistant", "resolution": [65, 65], "fov": 220}
ORTHOGRAPHIC = {"lens": "orthographic", "resolution": [512, 512], "fov": 180}
OPENCV = CALIBRATED["OPENCV"]
PANORAMA = {"lens": "equirectangular", "resolution": [64, 32]}
HALF_PANORAMA = {"lens": "equirectangular", "longitude": [-90, 90], "resolution": [32, 32]}


class Dataset:
    """A folder with a lightfield.json and its exports."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write(self, camera: Any, rig: Any = RIG, **keys: Any) -> dict[str, Any]:
        lightfield = LightField.from_rig(rig, lenses.from_camera(camera), **keys)
        lightfield.write(self.folder / "lightfield.json")
        return lightfield.to_json()

    def export(self, *arguments: Any) -> dict[str, Any]:
        """Return the transforms.json that the program writes for these arguments."""
        paths = ["--input-cfg", self.folder / "lightfield.json"]
        paths += ["--output", self.folder / "transforms.json"]
        parsed(TransformsByHand, None, [*map(str, [*paths, *arguments])]).run()
        return self.read("transforms.json")

    def read(self, name: str) -> dict[str, Any]:
        result: dict[str, Any] = json.loads((self.folder / name).read_text())
        return result

    def render(
        self, content: dict[str, Any], camera: Any, meaning: str | None, distance: float
    ) -> None:
        """Write EXR views of a sphere around each camera. All rays have the same distance."""
        cosine = -lenses.from_camera(camera).pixel_rays()[..., 2]
        depth = distance * cosine if meaning == "z" else np.full_like(cosine, distance)
        depth = np.where(np.isnan(cosine), np.inf, depth).astype(np.float32)
        colour = np.full(depth.shape, 0.25, np.float16)
        for frame in content["frames"]:
            images.write_exr(
                self.folder / f"{frame['name']}.exr",
                {"R": colour, "G": colour, "B": colour, "Z": depth},
                {images.DEPTH_ATTRIBUTE: meaning} if meaning else {},
            )


@pytest.fixture
def dataset(tmp_path: Path) -> Dataset:
    return Dataset(tmp_path)


class Loader:
    """Reads a transforms.json as instant-ngp does: camera matrices and the rays of pixels."""

    def __init__(self, transforms: dict[str, Any]) -> None:
        self.json = transforms
        self.scale = np.float32(transforms.get("scale", 0.33))
        self.offset = np.array(transforms.get("offset", [0.5, 0.5, 0.5]), np.float32)

    def position(self, nerf: Any) -> Any:
        x, y, z = np.asarray(nerf, np.float32) * self.scale + self.offset
        return np.array([y, z, x])

    def camera(self, frame: int) -> tuple[Any, Any]:
        matrix = np.array(self.json["frames"][frame]["transform_matrix"], np.float32)
        axes = matrix[:3, :3] * np.float32([1, -1, -1])
        return axes[[1, 2, 0]], self.position(matrix[:3, 3])

    def ray(self, frame: int, x: float, y: float) -> tuple[Any, Any]:
        """Return origin and unnormalised direction. The direction is zero for a hidden pixel."""
        axes, origin = self.camera(frame)
        width, height = np.float32(self.json["w"]), np.float32(self.json["h"])
        u = np.float32(x) / width - np.float32(self.json["cx"]) / width
        v = np.float32(y) / height - np.float32(self.json["cy"]) / height
        if "ftheta_p0" in self.json:
            across, down = u * width, v * height
            radius = np.sqrt(across * across + down * down)
            angle = np.float32(0)
            for power in range(4, -1, -1):
                angle = angle * radius + np.float32(self.json[f"ftheta_p{power}"])
            if np.cos(angle) <= np.finfo(np.float32).tiny or radius == 0:
                return origin, np.zeros(3)
            side = np.sin(angle) / radius
            local = np.array([side * across, side * down, np.cos(angle)])
        elif self.json.get("latlong"):
            theta = (y / height - 0.5) * math.pi
            phi = (x / width - 0.5) * math.pi * 2
            local = np.array(
                [
                    math.sin(phi) * math.cos(theta),
                    math.sin(theta),
                    math.cos(phi) * math.cos(theta),
                ]
            )
        elif any(self.json.get(key) for key in ("k1", "k2", "p1", "p2")):
            local = np.append(self.undistorted(u * width, v * height), 1)
        else:
            local = np.array([u * width / self.json["fl_x"], v * height / self.json["fl_y"], 1])
        return origin, axes @ local.astype(np.float32)

    def undistorted(self, across: float, down: float) -> Any:
        """Return the tangents of OpenCV's point at this many pixels from the principal point."""
        # The loader puts k3 and k4 where p1 and p2 are.
        assert not {"k3", "k4"} & {*self.json}
        parameters = [self.json["fl_x"], self.json["fl_y"], 0, 0]
        parameters += [self.json[key] for key in ("k1", "k2", "p1", "p2")]
        camera = pycolmap.Camera(model="OPENCV", width=64, height=48, params=parameters)
        return camera.cam_from_img(np.array([float(across), float(down)]))


def silvr_orientation(point: Any) -> list[float]:
    x, y, z = point
    return [y, -x, z]


def seen_at(content: dict[str, Any], frame: int, point: Any) -> tuple[float, float]:
    """Return the pixel at which lightfield.json's camera sees a world point."""
    matrix = np.array(content["frames"][frame]["world_matrix"])
    x, y, z = matrix[:3, :3].T @ (np.asarray(point) - matrix[:3, 3])
    width, height = content["resolution"]
    camera = content["camera"]
    if camera["type"] == "PERSP":
        clip = np.array(camera["projection_matrix"]) @ [x, y, z, 1]
        return (1 + clip[0] / clip[3]) / 2 * width, (1 - clip[1] / clip[3]) / 2 * height
    if camera["panorama_type"] == "EQUIRECTANGULAR":
        longitude, latitude = math.atan2(x, -z), math.asin(y / math.hypot(x, y, z))
        return (0.5 + longitude / (2 * math.pi)) * width, (0.5 - latitude / math.pi) * height
    radius = math.acos(-z / math.hypot(x, y, z)) / camera["fisheye_fov"] * width
    side = math.hypot(x, y)
    return width / 2 + radius * x / side, height / 2 - radius * y / side


def angle_between(a: Any, b: Any) -> float:
    a, b = np.asarray(a, float), np.asarray(b, float)
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


@pytest.mark.parametrize("camera", [PERSPECTIVE, FISHEYE, WIDE, PANORAMA])
def test_the_loaders_ray_of_a_pixel_meets_the_point_seen_there(
    camera: Any, dataset: Dataset
) -> None:
    content = dataset.write(camera)
    transforms = dataset.export("--scale", 0.1, "--offset", 0.5, 0.75, 0.4)
    loader = Loader(transforms)
    widest = {"rectilinear": 0.8, "equidistant": 1.55, "equirectangular": 3.1}[camera["lens"]]
    random = np.random.default_rng(7)
    for frame in range(len(content["frames"])):
        matrix = np.array(content["frames"][frame]["world_matrix"])
        for theta in (0.02, 0.3, *random.uniform(0, widest, 20)):
            phi = random.uniform(0, 2 * math.pi)
            ray = [
                math.sin(theta) * math.cos(phi),
                math.sin(theta) * math.sin(phi),
                -math.cos(theta),
            ]
            point = matrix[:3, :3] @ ray * random.uniform(0.5, 20) + matrix[:3, 3]
            origin, direction = loader.ray(frame, *seen_at(content, frame, point))
            target = loader.position(silvr_orientation(point))
            assert angle_between(direction, target - origin) < 1e-4


def test_a_perspective_lens_is_named_by_its_angles_and_focal_lengths(dataset: Dataset) -> None:
    dataset.write(PERSPECTIVE)
    transforms = dataset.export()
    expected = {"fl_x": 64 * 20 / 36, "fl_y": 48 * 20 / 30, "cx": 29.5, "cy": 26.25}
    expected |= {"camera_angle_x": 2 * math.atan(18 / 20), "w": 64, "h": 48}
    expected |= {"camera_angle_y": 2 * math.atan(15 / 20)}
    assert {key: transforms[key] for key in expected} == pytest.approx(expected)


def test_a_camera_worked_by_hand(dataset: Dataset) -> None:
    """One camera is level at (1, 2, 3) and looks along +Y. One at (3, 2, 3) looks straight down."""
    rows = ["name,x,y,z,rx,ry,rz", f"a,1,2,3,{math.pi / 2},0,0", "b,3,2,3,0,0,0"]
    (dataset.folder / "poses.csv").write_text("\n".join(rows))
    rig = {"type": "poses", "file": str(dataset.folder / "poses.csv")}
    dataset.write({"lens": "rectilinear", "resolution": [256, 256], "focal_length": 18}, rig)
    transforms = dataset.export("--scale", 0.1, "--offset", 0.5, 0.5, 0.2)
    level, down = (frame["transform_matrix"] for frame in transforms["frames"])
    np.testing.assert_allclose(
        level, [[0, 0, -1, 2], [-1, 0, 0, -1], [0, 1, 0, 3], [0, 0, 0, 1]], atol=1e-9
    )
    np.testing.assert_allclose(
        down, [[0, 1, 0, 2], [-1, 0, 0, -3], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-9
    )
    # The mean camera, (2, 2, 3), is at (2, −2, 3) there.
    np.testing.assert_allclose(transforms["offset"], [0.3, 0.7, -0.1], atol=1e-12)
    assert transforms["scale"] == 0.1
    assert transforms["camera_angle_x"] == pytest.approx(math.pi / 2)
    assert (transforms["fl_x"], transforms["cx"], transforms["w"]) == (128, 128, 256)


def test_frames_keep_the_views_order_under_natural_sorting(dataset: Dataset) -> None:
    rig = {"type": "plane", "cameras": [12, 2]}
    content = dataset.write({**FISHEYE, "resolution": [1, 1]}, rig)
    # These are names of a rig of more than 10,000 views.
    for number, frame in enumerate(content["frames"][12:], 9990):
        frame["name"] = f"view_{number:04d}f"
    (dataset.folder / "lightfield.json").write_text(json.dumps(content))
    transforms = dataset.export()
    paths = [frame["file_path"] for frame in transforms["frames"]]
    assert paths == [f"{frame['name']}.png" for frame in content["frames"]]

    def natural(path: str) -> list[Any]:
        return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path)]

    assert sorted(paths, key=natural) == paths


def test_fisheye_beyond_ninety_degrees_and_the_exact_centre_are_hidden(dataset: Dataset) -> None:
    content = dataset.write(WIDE)
    for frame in content["frames"]:
        images.write_png(dataset.folder / f"{frame['name']}.png", np.ones((65, 65, 3), np.uint8))
    loader = Loader(dataset.export())
    for frame in content["frames"]:
        mask = images.read_image(dataset.folder / f"dynamic_mask_{frame['name']}.png").channels["Y"]
        for y in range(0, 65, 4):
            for x in range(0, 65, 4):
                _, direction = loader.ray(0, x + 0.5, y + 0.5)
                assert (mask[y, x] == 255) == (not direction.any())
    assert mask[32, 32] == 255


def test_pixels_without_a_source_are_hidden(dataset: Dataset) -> None:
    content = dataset.write(PERSPECTIVE)
    pixels = np.full((48, 64, 4), 200, np.uint8)
    pixels[:5, :7, 3] = 0
    pixels[5, 5, 3] = 1
    for frame in content["frames"][1:]:
        images.write_png(dataset.folder / f"{frame['name']}.png", pixels[:, :, :3])
    images.write_png(dataset.folder / "view_0000f.png", pixels)
    dataset.export()
    assert [path.name for path in dataset.folder.glob("dynamic_mask_*")] == [
        "dynamic_mask_view_0000f.png"
    ]
    mask = images.read_image(dataset.folder / "dynamic_mask_view_0000f.png").channels["Y"]
    np.testing.assert_array_equal(mask == 255, pixels[:, :, 3] == 0)
    images.write_png(dataset.folder / "view_0000f.png", pixels[:, :, :3])
    dataset.export()
    assert not list(dataset.folder.glob("dynamic_mask_*"))


def test_empty_pixels_of_transparent_views_are_not_hidden(dataset: Dataset) -> None:
    content = dataset.write(PERSPECTIVE, render={"transparent": True})
    clear = np.zeros((48, 64, 4), np.uint8)
    half = np.full((48, 64), 0.5, np.float16)
    for frame in content["frames"]:
        images.write_png(dataset.folder / f"{frame['name']}.png", clear)
        images.write_exr(dataset.folder / f"{frame['name']}.exr", dict.fromkeys("RGBA", half))
    dataset.export()
    assert not list(dataset.folder.glob("dynamic_mask_*"))
    transforms = dataset.export("--image-suffix", ".exr")
    copied = images.read_image(dataset.folder / transforms["frames"][0]["file_path"]).channels
    assert copied.keys() == set("RGBA")
    np.testing.assert_array_equal(copied["A"], half)


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_views_of_two_rigs_go_into_one_list_beside_the_first_rigs_views(
    tmp_path: Path, suffix: str
) -> None:
    rigs = {"near": RIG, "far": RIG | {"center": [0.2, 0.4, -0.3], "split": {"every": 3}}}
    for name, rig in rigs.items():
        write_views(tmp_path / name / "small", FISHEYE, rig, suffix, look_at_ball)
    options = InstantNgp(sources=["small"], together=["near", "far"], depth=suffix == ".exr")
    source = SourceDataset(tmp_path / "near", "small", suffix, {"far": tmp_path / "far"})
    exports.run(source, options, tmp_path / "near/small")
    # A package has only the first rig's folder.
    (tmp_path / "near/small").rename(tmp_path / "package")
    near, far = (
        {view.name: (folder / f"{view.name}{suffix}", view) for view in _views(folder)}
        for folder in (tmp_path / "package", tmp_path / "far/small")
    )
    expected = near | {f"far_{name}": view for name, view in far.items()}

    package = Dataset(tmp_path / "package")
    transforms = package.read("transforms.json")
    assert _names(transforms) == [*expected]
    loader = Loader(transforms)
    cosine = -lenses.from_camera(FISHEYE).pixel_rays()[..., 2]
    has_ray = np.isfinite(cosine)
    for number, (path, view) in enumerate(expected.values()):
        frame = transforms["frames"][number]
        true = images.read_image(path).channels
        picture = package.folder / frame["file_path"]
        seen = images.read_image(picture).channels
        np.testing.assert_array_equal(seen["G"][has_ray], true["G"][has_ray])
        place = loader.position(silvr_orientation(view.position))
        np.testing.assert_allclose(loader.camera(number)[1], place, atol=1e-6)
        if suffix == ".png":
            mask = images.read_image(picture.with_name(f"dynamic_mask_{picture.stem}.png"))
            np.testing.assert_array_equal(mask.channels["Y"] == 255, ~has_ray)
        else:
            steps = images.read_image(package.folder / frame["depth_path"]).channels["Y"]
            z = steps * transforms["integer_depth_scale"] * cosine
            np.testing.assert_allclose(z[has_ray], true["Z"][has_ray], atol=0.001)
    for part in ("train", "test"):
        in_part = [name for name, (_, view) in expected.items() if view.split == part]
        assert _names(package.read(f"transforms_{part}.json")) == in_part


def _views(folder: Path) -> list[View]:
    return LightField.read(folder / "lightfield.json").views


def _names(transforms: dict[str, Any]) -> list[str]:
    return [Path(frame["file_path"]).stem for frame in transforms["frames"]]


def test_missing_images_are_a_warning(dataset: Dataset, capsys: pytest.CaptureFixture[str]) -> None:
    dataset.write(PERSPECTIVE)
    images.write_png(dataset.folder / "view_0000f.png", np.ones((48, 64, 3), np.uint8))
    assert len(dataset.export()["frames"]) == 6
    first = dataset.folder / "view_0001f.png"
    expected = f"warning: 5 images are missing, the first is {first}\n"
    assert capsys.readouterr().err.endswith(expected)


@pytest.mark.parametrize("meaning", ["z", "distance"])
@pytest.mark.parametrize("camera", [PERSPECTIVE, FISHEYE, OPENCV])
def test_the_loaders_depth_is_the_true_distance(
    camera: Any, meaning: str, dataset: Dataset
) -> None:
    content = dataset.write(camera, depth=meaning)
    dataset.render(content, camera, meaning, 3.25)
    transforms = dataset.export("--image-suffix", ".exr", "--depth-dir", dataset.folder / "depth")
    loader = Loader(transforms)
    frame = transforms["frames"][1]
    depth = images.read_image(dataset.folder / frame["depth_path"]).channels["Y"]
    assert depth.dtype == np.uint16
    width, height = content["resolution"]
    for x, y in ((5, 40), (30, 20), (50, 11), (32, 2)):
        _, direction = loader.ray(1, x + 0.5, y + 0.5)
        length = float(np.linalg.norm(direction))
        target = length * float(depth[y, x]) * transforms["integer_depth_scale"]
        assert target == pytest.approx(3.25, abs=0.0006 * length)
    if camera is FISHEYE:
        assert depth[0, 0] == depth[height - 1, width - 1] == 0


def test_exr_views_become_files_that_the_loader_accepts(dataset: Dataset) -> None:
    content = dataset.write(FISHEYE)
    dataset.render(content, FISHEYE, "z", 2.0)
    transforms = dataset.export("--image-suffix", ".exr")
    assert [frame["file_path"] for frame in transforms["frames"]] == [
        f"instant_ngp/{frame['name']}.exr" for frame in content["frames"]
    ]
    y, x = np.mgrid[:64, :64] + 0.5
    outside = np.hypot(x - 32, y - 32) > 32
    for frame in transforms["frames"]:
        channels = images.read_image(dataset.folder / frame["file_path"]).channels
        assert {name: pixels.dtype for name, pixels in channels.items()} == dict.fromkeys(
            "RGB", np.dtype(np.float16)
        )
        np.testing.assert_array_equal(channels["R"], np.where(outside, -1, 0.25))
    # Views may be without depth.
    for frame in content["frames"]:
        path = dataset.folder / f"{frame['name']}.exr"
        colour = images.read_image(path, "RGB").channels
        images.write_exr(path, {name: colour[name] for name in "RGB"})
    elsewhere = dataset.folder / "elsewhere"
    transforms = dataset.export("--image-suffix", ".exr", "--exr-dir", elsewhere)
    assert transforms["frames"][0]["file_path"] == "elsewhere/view_0000f.exr"
    assert len(list(elsewhere.iterdir())) == 6


def test_a_linked_folder_of_pictures_is_named_as_a_folder(dataset: Dataset) -> None:
    content = dataset.write(PERSPECTIVE)
    dataset.render(content, PERSPECTIVE, "z", 2.5)
    (dataset.folder / "disk/deep").mkdir(parents=True)
    (dataset.folder / "instant_ngp").symlink_to(dataset.folder / "disk/deep")
    frames = dataset.export("--image-suffix", ".exr")["frames"]
    name = content["frames"][0]["name"]
    assert frames[0]["file_path"] == f"instant_ngp/{name}.exr"
    assert (dataset.folder / "disk/deep" / f"{name}.exr").is_file()


def test_exr_pixels_without_a_source_are_hidden(dataset: Dataset) -> None:
    content = dataset.write(PERSPECTIVE, depth="z")
    dataset.render(content, PERSPECTIVE, "z", 2.0)
    path = dataset.folder / "view_0000f.exr"
    channels = images.read_image(path).channels
    without_source = np.zeros((48, 64), bool)
    without_source[:5, :7] = True
    channels = {
        name: np.where(without_source, np.nan if name == "Z" else 0, pixels).astype(pixels.dtype)
        for name, pixels in channels.items()
    }
    images.write_exr(path, channels, {images.DEPTH_ATTRIBUTE: "z"})
    frames = dataset.export("--image-suffix", ".exr")["frames"]
    first, second = (images.read_image(dataset.folder / f["file_path"]) for f in frames[:2])
    for name in "RGB":
        expected = np.where(without_source, -1, 0.25)
        np.testing.assert_array_equal(first.channels[name], expected)
        np.testing.assert_array_equal(second.channels[name], 0.25)


def test_a_depth_map_has_millimetres_and_0_without_depth() -> None:
    depth = np.array([2.0, 0.001, 0.0004, 65.535, 65.5361, np.inf, np.nan])
    steps, lost = in_16_bits(depth / 0.001)
    assert steps.tolist() == [2000, 1, 0, 65535, 0, 0, 0]
    assert lost == 2


@pytest.mark.parametrize("camera", [PERSPECTIVE, WIDE, PANORAMA])
@pytest.mark.parametrize("distance", [3.0, 64.0, 200.0, 950.0])
def test_the_loader_finds_a_far_background_where_it_is(
    dataset: Dataset, capsys: Any, camera: Any, distance: float
) -> None:
    """The loader multiplies a depth map by integer_depth_scale, and by the length of the ray."""
    meaning = "z" if camera is PERSPECTIVE else "distance"
    content = dataset.write(camera, depth=meaning)
    dataset.render(content, camera, meaning, distance)
    transforms = dataset.export("--depth-dir", dataset.folder / "depth")
    scale = transforms["integer_depth_scale"]
    # It is as exact as 16 bits allow.
    assert scale == max(0.001, scale) <= max(0.001, distance / 65535 * 1.001)
    for frame in transforms["frames"]:
        depth = images.read_image(dataset.folder / frame["depth_path"]).channels["Y"] * scale
        true = images.read_image(dataset.folder / f"{Path(frame['file_path']).stem}.exr")
        far = true.channels["Z"]
        np.testing.assert_allclose(depth[np.isfinite(far)], far[np.isfinite(far)], atol=scale)
        assert (depth[~np.isfinite(far)] == 0).all()
    assert "depths are 0" not in capsys.readouterr().out


def test_depths_that_no_16_bits_hold_beside_near_ones_are_counted(
    dataset: Dataset, capsys: Any
) -> None:
    dataset.render(dataset.write(FISHEYE, depth="distance"), FISHEYE, "distance", 20_000.0)
    transforms = dataset.export("--depth-dir", dataset.folder / "depth")
    assert transforms["integer_depth_scale"] * 65535 == pytest.approx(999.9)
    has_ray = np.isfinite(lenses.from_camera(FISHEYE).pixel_rays()[..., 0])
    (note,) = re.findall(r"note: .*: (\d+) of (\d+) depths are 0", capsys.readouterr().out)
    assert tuple(map(int, note)) == (6 * has_ray.sum(), 6 * has_ray.size)


def test_the_scenes_box_holds_all_cameras_and_nine_tenths_of_the_points() -> None:
    points = np.linspace([0, 10, 20], [100, 110, 120], 101)
    low, high = instant_ngp.scene_bounds(np.array([[50.0, 2, 60], [200, 60, 70]]), points)
    np.testing.assert_allclose((low, high), [[5, 2, 25], [200, 105, 115]])
    scale, offset = instant_ngp.fitted(low, high)
    assert scale == 1 / 195
    loader = Loader({"scale": scale, "offset": offset})
    middle = loader.position(silvr_orientation((low + high) / 2))
    np.testing.assert_allclose(middle, 0.5, atol=1e-6)


def in_unit_cube(loader: Loader, points: Any) -> bool:
    return all(
        np.all(np.abs(loader.position(silvr_orientation(point)) - 0.5) <= 0.5 + 1e-6)
        for point in points
    )


def test_a_box_fitted_to_the_rig_is_a_fifth_of_the_cube_and_centred(dataset: Dataset) -> None:
    content = dataset.write(FISHEYE, {"type": "sphere", "subdivisions": 2, "center": [5, 6, 7]})
    loader = Loader(dataset.export())
    positions = np.array(
        [loader.position(silvr_orientation(frame["position"])) for frame in content["frames"]]
    )
    np.testing.assert_allclose((positions.min(0) + positions.max(0)) / 2, 0.5, atol=1e-6)
    assert np.ptp(positions, axis=0).max() == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize(
    "rig",
    [
        {"type": "sphere", "subdivisions": 1, "size": 3, "face_inside": True},
        {"type": "hemisphere", "count": 9, "elevation": [10, 60], "size": 3},
        {"type": "ring", "count": 5, "size": 3},
    ],
)
def test_a_rig_that_looks_inward_fills_the_cube_around_its_target(
    rig: Any, dataset: Dataset
) -> None:
    content = dataset.write(PERSPECTIVE, rig | {"center": [5, 6, 7]})
    loader = Loader(dataset.export())
    np.testing.assert_allclose(loader.position(silvr_orientation([5, 6, 7])), 0.5, atol=1e-6)
    places = [frame["position"] for frame in content["frames"]]
    assert in_unit_cube(loader, places)
    apart = [loader.position(silvr_orientation(place)) - 0.5 for place in places]
    assert np.abs(apart).max() == pytest.approx(0.5, abs=1e-6)


def test_a_point_beyond_the_rigs_reach_is_not_its_target() -> None:
    cameras = np.array([[98.0, 0, 0], [100, 0, 0], [102, 0, 0], [100, 0, 1]])
    for away, expected in ((2.5, None), (1.5, [100, 1.5, 0])):
        axes = np.array([100, away, 0]) - cameras
        target = instant_ngp.looked_at(cameras, axes / np.linalg.norm(axes, axis=1, keepdims=True))
        assert target is None if expected is None else np.allclose(target, expected)


def test_a_scene_fitted_to_depth_is_within_the_cube(dataset: Dataset) -> None:
    rig = {"type": "sphere", "subdivisions": 1, "size": 0.02, "center": [1, -2, 3]}
    content = dataset.write(FISHEYE, rig, depth="distance")
    dataset.render(content, FISHEYE, "distance", 4.0)
    transforms = dataset.export("--depth-bounds")
    loader = Loader(transforms)
    assert in_unit_cube(loader, [frame["position"] for frame in content["frames"]])
    # Of a sphere seen evenly from its centre, nine tenths lie within ±0.9 radii along any axis.
    assert transforms["scale"] == pytest.approx(1 / (2 * 0.9 * 4.0), rel=0.05)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    assert in_unit_cube(loader, [1, -2, 3] + 0.85 * 4.0 * corners)


def test_a_wall_straight_ahead_puts_the_rig_in_the_middle_of_the_cubes_sides(
    dataset: Dataset,
) -> None:
    # Of three by three pixels the bounds take the middle one, whose ray goes through its centre. So
    # they reach equally far to the left and to the right.
    camera = {"lens": "rectilinear", "fov": 90, "resolution": [192, 192]}
    rig = {"type": "plane", "cameras": [2, 2], "size": 0.5}
    content = dataset.write(camera, rig, depth="z")
    for frame in content["frames"]:
        pixels = {name: np.full((192, 192), 4, np.float32) for name in "RGBZ"}
        attributes = {images.DEPTH_ATTRIBUTE: "z"}
        images.write_exr(dataset.folder / f"{frame['name']}.exr", pixels, attributes)
    loader = Loader(dataset.export("--depth-bounds"))
    left, right = (loader.position(silvr_orientation([x, 0, 0])) for x in (-0.25, 0.25))
    np.testing.assert_allclose((left + right)[:2] / 2, 0.5, atol=1e-6)
    assert np.abs(right - left).max() == pytest.approx(0.5 * loader.scale, abs=1e-6)


def test_split_gives_odd_sequence_numbers_to_the_test_file(
    dataset: Dataset, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset.write(FISHEYE)
    all_frames = dataset.export()
    said = [line.split(", scale")[0] for line in capsys.readouterr().out.splitlines()]
    counts = {"transforms": 6, "transforms_train": 3, "transforms_test": 3}
    assert said == [f"{dataset.folder / name}.json: {counts[name]} frames" for name in counts]
    parts = {}
    for part in ("train", "test"):
        parts[part] = dataset.read(f"transforms_{part}.json")
        assert parts[part] | {"frames": 0} == all_frames | {"frames": 0}
    names = [Path(frame["file_path"]).stem for frame in parts["test"]["frames"]]
    assert names == ["view_0001f", "view_0003f", "view_0005f"]
    assert len(parts["train"]["frames"]) == 3
    assert len(all_frames["frames"]) == 6


def test_a_rig_that_tests_another_dataset_is_placed_like_it(dataset: Dataset) -> None:
    dataset.write(FISHEYE)
    trained = dataset.export()
    (dataset.folder / "transforms.json").rename(dataset.folder / "trained.json")
    dataset.write(FISHEYE, RIG | {"size": 5.0, "split": "test"})
    tested = dataset.export("--placed-as", dataset.folder / "trained.json")
    assert (tested["scale"], tested["offset"]) == (trained["scale"], trained["offset"])
    assert dataset.read("transforms_test.json") == tested
    assert not (dataset.folder / "transforms_validation.json").exists()


def test_a_part_that_the_split_has_no_more_leaves_no_list(dataset: Dataset) -> None:
    dataset.write(FISHEYE)
    dataset.export()
    assert (dataset.folder / "transforms_test.json").exists()
    dataset.write(FISHEYE, RIG | {"split": "train"})
    dataset.export()
    lists = sorted(path.name for path in dataset.folder.glob("transforms*.json"))
    assert lists == ["transforms.json", "transforms_train.json"]


def test_boxes_and_scales_are_passed_on(dataset: Dataset) -> None:
    dataset.write(FISHEYE)
    transforms = dataset.export("--aabb-scale", 16, "--render-aabb", 0.1, 0.2, 0.3, 0.7, 0.8, 0.9)
    assert transforms["aabb_scale"] == 16
    assert transforms["render_aabb"] == [[0.1, 0.2, 0.3], [0.7, 0.8, 0.9]]


def test_the_yaml_has_every_option_of_the_program(dataset: Dataset) -> None:
    content = dataset.write(FISHEYE, depth="distance")
    dataset.render(content, FISHEYE, "distance", 4.0)
    settings = {"sources": ["views"], "bounds": "depth", "aabb_scale": 2, "depth": True}
    box = [[0.1, 0.2, 0.3], [0.7, 0.8, 0.9]]
    model = TypeAdapter(InstantNgp).validate_python(settings | {"render_aabb": box})
    file = dataset.folder / "settings.json"
    file.write_text(json.dumps(ExportSettings(options=model).as_json()))
    transforms = dataset.export("--settings", file)
    assert transforms["scale"] == dataset.export("--depth-bounds")["scale"]
    assert transforms["options"] == model.recorded
    assert transforms["render_aabb"] == box
    assert transforms["aabb_scale"] == 2
    depth = dataset.folder / transforms["frames"][0]["depth_path"]
    assert depth.parent == dataset.folder / "instant_ngp" / "depth"
    assert images.read_image(depth).channels["Y"].max() == 4000
    with pytest.raises(UserError, match="--settings: excludes --scale"):
        dataset.export("--settings", file, "--scale", 1)
    with pytest.raises(ValidationError, match="bounds: does not go with scale"):
        TypeAdapter(InstantNgp).validate_python(settings | {"scale": 0.1})
    with pytest.raises(ValidationError, match="offset: needs scale"):
        TypeAdapter(InstantNgp).validate_python(settings | {"offset": [0, 0, 0]})


def test_a_settings_file_names_one_source(dataset: Dataset) -> None:
    dataset.write(FISHEYE)
    file = dataset.folder / "settings.json"
    file.write_text(json.dumps({"options": {"sources": ["views", "flat"]}}))
    with pytest.raises(UserError) as error:
        dataset.export("--settings", file)
    assert str(error.value).startswith(f"{file}: options.sources: must name one source")


@pytest.mark.parametrize(
    ("lens", "fov"), [("equisolid", 180), ("stereographic", 180), ("stereographic", 300)]
)
def test_other_fisheyes_are_approximated_to_a_quarter_of_a_pixel(
    lens: str, fov: float, dataset: Dataset
) -> None:
    camera: dict[str, Any] = {"lens": lens, "resolution": [512, 512], "fov": fov}
    if lens == "equisolid":
        camera |= {"focal_length": 36 / 2 / 2 / math.sin(math.pi / 4)}
    dataset.write(camera)
    loader = Loader(dataset.export())
    # The place of a ray of 90 degrees.
    rim = 256 * math.tan(math.radians(45)) / math.tan(math.radians(fov / 4))
    for x in 256 + np.linspace(2, rim - 3, 40):
        radius = (x - 256) / rim
        if lens == "equisolid":
            angle = 2 * math.asin(radius * math.sin(math.pi / 4))
        else:
            angle = 2 * math.atan(radius)
        axes, _ = loader.camera(0)
        _, direction = loader.ray(0, x, 256)
        pixel = 2 * math.sin(math.pi / 4) / math.cos(angle / 2) / rim
        assert abs(angle_between(direction, axes[:, 2]) - angle) < 0.25 * pixel


def test_the_loader_undistorts_opencvs_lens(dataset: Dataset) -> None:
    dataset.write(OPENCV)
    loader = Loader(dataset.export())
    lens = lenses.from_camera(OPENCV)
    axes, _ = loader.camera(0)
    for x, y in ((3, 4), (60, 10), (31, 24), (20, 44)):
        _, direction = loader.ray(0, x, y)
        # The loader's camera looks along z, with y down.
        expected = lens.rays(x, y) * [1, -1, -1]
        assert angle_between(axes.T @ direction, expected) < 1e-6


@pytest.mark.parametrize("turned", [1, -1])
def test_a_polynomial_lens_is_exported_exactly(turned: int, dataset: Dataset) -> None:
    terms = [0.01, -0.1, 2e-3, -3e-4, 1e-5]  # Radians per mm^i; a pixel has 36 / 64 mm.
    coefficients = [turned * term for term in terms]
    lens = {"lens": "polynomial", "coefficients": coefficients, "resolution": [64, 64]}
    dataset.write(lens | {"fov": 140})
    transforms = dataset.export()
    for power, term in enumerate(coefficients):
        expected = -term * (36 / 64) ** power
        assert transforms[f"ftheta_p{power}"] == pytest.approx(expected, abs=1e-9)
    assert transforms["fl_x"] == transforms["fl_y"] == pytest.approx(64 / 36 / 0.1)
    dataset.write(FISHEYE)
    transforms = dataset.export()
    linear = [transforms[f"ftheta_p{power}"] for power in range(5)]
    assert linear == [0, pytest.approx(math.pi / 64, rel=1e-9), 0, 0, 0]
    assert transforms["fl_x"] == pytest.approx(64 / math.pi)
    # The loader's polynomial has few terms, and misses it by less than a quarter of a pixel.
    dataset.write(ORTHOGRAPHIC | {"resolution": [32, 32]})
    assert dataset.export()["w"] == 32


@pytest.mark.parametrize(
    ("camera", "arguments", "message"),
    [
        (ORTHOGRAPHIC, [], r"lightfield.json: camera: instant-ngp cannot .* by 3.3 pixels"),
        (ORTHOGRAPHIC | {"resolution": [64, 64]}, [], "misses it by 0.41 pixels"),
        (ORTHOGRAPHIC | {"resolution": [40, 40]}, [], "misses it by 0.26 pixels"),
        (PANORAMA | {"latitude": [-45, 45]}, [], "instant-ngp cannot follow"),
        (CALIBRATED["FULL_OPENCV"], [], r"cannot follow this lens \(it has p1 or p2 beside k3"),
        (CALIBRATED["THIN_PRISM_FISHEYE"], [], r"cannot follow this lens \(it has a thin prism"),
        (PANORAMA | {"longitude": [-180, 170]}, [], "instant-ngp cannot follow"),
        # A fisheye along both axes of the image, but not between them.
        (HALF_PANORAMA, [], "instant-ngp cannot follow"),
        (FISHEYE, ["--depth-bounds", "--scale", 1], "bounds: does not go with scale"),
        (FISHEYE, ["--offset", 0, 0, 0], "--offset: needs --scale"),
        (FISHEYE, ["--scale", 1, "--offset", 0, "nan", 0], "--offset: is NaN; must be a finite"),
        (FISHEYE, ["--placed-as", __file__], r"\.py: is not JSON"),
        (FISHEYE, ["--image-suffix", ".exr"], "view_0000f.exr: no such file"),
        (FISHEYE, ["--depth-bounds"], "view_0000f.exr: no such file"),
    ],
)
def test_an_impossible_export_is_an_error(
    camera: Any, arguments: list[Any], message: str, dataset: Dataset
) -> None:
    dataset.write(camera, {"type": "plane", "cameras": [3, 1]})
    with pytest.raises(UserError, match=message):
        dataset.export(*arguments)
    assert [path.name for path in dataset.folder.iterdir()] == ["lightfield.json"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "required: --input-cfg, --output"),
        (["--image-suffix", ".jpg"], r"--image-suffix: invalid choice: '\.jpg'"),
        # Later versions of Python quote the number.
        (["--aabb-scale", "3"], r"--aabb-scale: invalid choice: (3|'3') "),
    ],
)
def test_impossible_arguments_are_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parsed(TransformsByHand, None, arguments)
    assert re.search(message, capsys.readouterr().err)


def test_one_camera_has_no_extent_to_fit(dataset: Dataset) -> None:
    dataset.write(FISHEYE, {"type": "plane", "cameras": [1, 1], "center": [1, 2, 3]})
    with pytest.raises(UserError, match="extent is zero"):
        dataset.export()
    # With a given scale, the mean camera lies in the middle.
    transforms = dataset.export("--scale", 2)
    np.testing.assert_allclose(Loader(transforms).camera(0)[1], 0.5)
    model = TypeAdapter(InstantNgp).validate_python({"sources": ["views"], "scale": 2})
    assert transforms["options"] == model.recorded


def test_views_of_another_size_or_of_unknown_depth_are_named(dataset: Dataset) -> None:
    content = dataset.write(FISHEYE, depth=None)
    small = np.zeros((8, 8), np.float16)
    for frame in content["frames"]:
        images.write_exr(dataset.folder / f"{frame['name']}.exr", dict.fromkeys("RGBZ", small))
    with pytest.raises(UserError, match=r"view_0000f.exr: is 8 × 8, but .* says 64 × 64"):
        dataset.export("--image-suffix", ".exr")
    images.write_png(dataset.folder / "view_0000f.png", np.zeros((9, 8, 3), np.uint8))
    with pytest.raises(UserError, match=r"view_0000f.png: is 8 × 9, but .* says 64 × 64"):
        dataset.export()
    black = np.zeros((64, 64), np.float16)
    for frame in content["frames"]:
        images.write_exr(dataset.folder / f"{frame['name']}.exr", dict.fromkeys("RGBZ", black))
    with pytest.raises(UserError, match="depth: is None; must be z or distance"):
        dataset.export("--depth-bounds")


def test_the_program_names_what_is_wrong_in_a_line(dataset: Dataset, run_program: Any) -> None:
    arguments = ("--input-cfg", dataset.folder / "lightfield.json")
    arguments += ("--output", dataset.folder / "transforms.json")
    result = run_program("export_instant_ngp.py", *arguments, check=False)
    assert result.returncode == 1
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
    dataset.write(FISHEYE)
    run_program("export_instant_ngp.py", *arguments)
    assert len(dataset.read("transforms.json")["frames"]) == 6
