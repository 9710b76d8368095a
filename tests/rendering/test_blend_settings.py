"""What becomes of the settings of a .blend: each case beside Blender's own picture."""

import contextlib
import io
from fnmatch import fnmatch
from functools import cache
from importlib.metadata import version

import blend_scenes
import numpy as np
import one_shard
import pytest
from blend_settings import IGNORED, LOOK, NO_CASE, OWNERS, PAGE, REFUSED, ROWS, page

from lightfield.configuration.config_file import Preset
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.imaging import images
from lightfield.planning.loading import datasets_of
from lightfield.rendering.views import lightfield_file
from lightfield.stages.lenses import Reproject
from lightfield.workflow import job_settings

CASES = [
    pytest.param(case, case.outcome or row.outcome, id=f"{row.settings}-{case.name}")
    for row in ROWS
    for case in row.cases
    if case.since <= tuple(map(int, version("bpy").split(".")[:2]))
]
LOOKS = [
    pytest.param(case, id=case.name) for row in ROWS if row.settings == LOOK for case in row.cases
]
# Two pictures are equal if fewer of their pixels differ, and different if more do.
EQUAL = 0.002
DIFFERENT = 0.02


def apply(change):
    """Change the open file: by a function, or by values of properties."""
    import bpy

    if callable(change):
        change()
        return
    for path, value in (change or {}).items():
        owner, _, name = path.partition(".")
        setattr(blend_scenes.roots(bpy.context.scene)[owner], name, value)


def save(path, scene, *changes):
    """Save a .blend of a scene with some changes."""
    import bpy

    scene()
    for change in changes:
        apply(change)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)


def of_blender(path, file_format):
    """Return the picture (height, width, 4) that Blender itself makes of a .blend."""
    import bpy

    open_file(path)
    render = bpy.context.scene.render
    suffix = "exr" if file_format == "OPEN_EXR" else "png"
    render.image_settings.file_format = file_format
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32" if suffix == "exr" else "16"
    render.filepath = str(path.with_suffix(f".colour.{suffix}"))
    render_quietly()
    # A stereo pair has a file for each eye, and the left one is often where the camera is.
    file = max(path.parent.glob(f"{path.stem}.colour*.{suffix}"))
    image = images.read_image(file, "RGBA")
    return np.stack([image.channels[name] for name in "RGBA"], axis=-1).astype(np.float32)


def depth_of_blender(path):
    """Return Blender's depth (height, width) of a .blend at the pixels' centres, at its frame.

    As in the datasets, it sees through fog.
    """
    import bpy

    open_file(path)
    scene = bpy.context.scene
    scene.cycles.samples = 1
    scene.cycles.pixel_filter_type = "BLACKMAN_HARRIS"
    scene.cycles.filter_width = 0.01
    scene.render.use_motion_blur = False
    scene.camera.data.dof.use_dof = False
    if "Fog" in scene.objects:
        scene.objects["Fog"].hide_render = True
    layer = next(layer for layer in scene.view_layers if layer.use)
    layer.use_pass_z = True
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path.with_suffix(".depth.exr"))
    render_quietly()
    file = max(path.parent.glob(f"{path.stem}.depth*.exr"))
    channel = f"{layer.name}.Depth.Z"
    return images.read_image(file, [channel]).channels[channel]


def open_file(path):
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)


def render_quietly():
    import bpy

    from lightfield.rendering.scenes.quiet import quiet

    with quiet():
        bpy.ops.render.render(write_still=True)


@pytest.fixture(scope="module")
def without_change(tmp_path_factory):
    """Return a function: Blender's picture and depth of a case's scene without its change."""
    folder = tmp_path_factory.mktemp("default")

    @cache
    def picture(scene, by_hand, file_format):
        path = folder / "default.blend"
        save(path, scene, by_hand)
        return of_blender(path, file_format), depth_of_blender(path)

    return lambda case, file_format: picture(case.scene, case.by_hand, file_format)


def of_plenoforge(path, yaml):
    """Return the picture (height, width, 4), depth, and the note that Plenoforge makes."""
    from lightfield.rendering.inspection import inventory_file

    content = {
        "scene": {
            "blend": str(path),
            "url": "https://example.org/a.blend",
            "sha256": sha256(path),
            **yaml.get("scene", {}),
        },
        "render": {"samples": blend_scenes.SAMPLES, "seed": 0, **yaml.get("render", {})},
        "rigs": {
            "views": {
                "type": "blend_camera",
                "camera": {"lens": "file", "resolution": list(blend_scenes.SIZE)},
            }
        },
        "reprojections": yaml.get("reprojections", {}),
    }
    written = Scene.model_validate(content)
    (dataset,) = datasets_of("tried", written, "full", Preset(), {})
    inventory = path.with_suffix(".json")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        settings = job_settings.inventory(dataset)
        inventory_file.write(path, settings, [dataset], inventory, False)
    views = lightfield_file.from_settings(job_settings.lightfield(dataset), inventory)
    folder = path.parent / "exr"
    with contextlib.redirect_stderr(io.StringIO()):
        one_shard.render(views, path.parent, path, inventory=inventory)
    for name, settings in dataset.reprojections.items():
        Reproject(
            settings=settings,
            input_cfg=path.parent / "lightfield.json",
            input_dir=folder,
            output_dir=path.parent / name,
        ).run()
    channels = "RGBA" if views.transparent else "RGB"
    image = images.read_image(folder / f"{views.views[0].name}.exr", [*channels, "Z"])
    pixels = np.stack([image.channels[name] for name in channels], axis=-1)
    return pixels.astype(np.float32), image.channels["Z"], said.getvalue()


def difference(picture, other):
    """Return the share of pixels that differ by more than half floats do."""
    if picture.shape[:2] != other.shape[:2]:
        return 1.0
    channels = min(picture.shape[2], other.shape[2])
    a, b = (x[..., :channels].astype(np.float32) for x in (picture, other))
    is_close = np.isclose(a, b, rtol=2e-3, atol=2e-3, equal_nan=True)
    return float(1 - is_close.all(axis=-1).mean())


@pytest.mark.slow
@pytest.mark.parametrize(("case", "outcome"), CASES)
def test_a_setting_of_a_blend_becomes_what_the_reference_says(
    case, outcome, without_change, tmp_path
):
    path = tmp_path / "tried.blend"
    save(path, case.scene, case.change)
    if outcome == REFUSED:
        with pytest.raises(UserError) as refusal:
            of_plenoforge(path, case.yaml)
        assert case.note in str(refusal.value)
        assert "\n" not in str(refusal.value)
        return
    pixels, own_depth, said = of_plenoforge(path, case.yaml)
    assert case.note is None or case.note in said
    reference = tmp_path / "reference.blend"
    save(reference, case.scene, case.change, case.by_hand)
    changed = of_blender(reference, case.format)
    # Otherwise the case would prove nothing.
    assert difference(changed, without_change(case, case.format)[0]) > DIFFERENT
    if outcome == IGNORED:
        expected, depth = without_change(case, "OPEN_EXR")
    else:
        expected, depth = changed, depth_of_blender(reference)
    assert difference(pixels, expected) < EQUAL
    assert difference(own_depth[..., None], np.where(depth < 1e9, depth, np.inf)[..., None]) < EQUAL


@pytest.mark.slow
@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("case", LOOKS)
def test_look_file_gives_blenders_own_picture(case, transparent, tmp_path):
    def with_film():
        apply({"render.film_transparent": transparent, "view.exposure": 0.5})

    path = tmp_path / "tried.blend"
    save(path, case.scene, with_film, case.change)
    developed = {"png": {"look": "file", "bits": 16}}
    render = {"render": {"transparent": True}} if transparent else {}
    _, _, said = of_plenoforge(path, {"reprojections": developed, **render})
    assert "applied by look: file" in said
    (file,) = (tmp_path / "png").glob("*.png")
    channels = "RGBA" if transparent else "RGB"
    image = images.read_image(file, channels)
    pixels = np.stack([image.channels[name] for name in channels], axis=-1) / 65535
    expected = of_blender(path, "PNG")[..., : len(channels)] / 65535
    assert pixels.max() > 0.5
    assert np.abs(pixels - expected).max() <= 1 / 255


def test_the_reference_has_the_table_of_the_settings_that_were_tried():
    assert PAGE.read_text() == page(PAGE.read_text()), "run tests/blender/blend_settings.py"


@pytest.mark.slow
def test_each_property_that_blender_has_is_tried_or_accounted_for():
    import bpy

    tried = {
        path
        for row in ROWS
        for case in row.cases
        if not callable(case.change)
        for path in case.change
    }
    patterns = [pattern for text in NO_CASE.values() for pattern in text.split()]
    blend_scenes.fog()
    owners = blend_scenes.roots(bpy.context.scene)
    forgotten = [
        path
        for name in OWNERS
        for setting in owners[name].bl_rna.properties
        if not setting.is_readonly and setting.type != "COLLECTION"
        # The import of a glTF in an earlier test adds this one.
        if setting.identifier != "gltf2_active_variant"
        if (path := f"{name}.{setting.identifier}") not in tried
        if not any(fnmatch(path, pattern) for pattern in patterns)
    ]
    assert forgotten == []
