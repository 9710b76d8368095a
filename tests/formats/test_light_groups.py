"""Light groups add up to the colour, and other strengths of them are the scene in another light."""

import json
import re
import shutil

import numpy as np
import pytest
import yaml
from conftest import BLENDER
from light_group_views import LENSES

from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.config_file import Preset
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.light_groups import names_in, resolved
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.planning.cost import rendering, reprojecting, view_cost
from lightfield.planning.loading import scene_datasets
from lightfield.reprojection.filters import FILTERS
from lightfield.validation.validate import validate

CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}


@pytest.fixture(scope="module")
def made(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("light_groups")
    run_program(BLENDER / "light_group_views.py", folder)
    return folder


def colour(folder, name="exr", view="view_0000f"):
    return images.read_image(folder / name / f"{view}.exr").colour


def group_names(folder):
    return sorted(path.name for path in folder.glob("Combined_*"))


def largest_difference(folder):
    """Return by which part of the colour the sum of all groups differs from it."""
    total = sum(colour(folder, name) for name in group_names(folder))
    seen = colour(folder)
    return (np.abs(total - seen) / np.maximum(seen, 1e-3)).max()


@pytest.mark.parametrize("name", [*LENSES, "transparent", "clamped", "named"])
def test_groups_add_up_to_the_colour(name, made):
    assert largest_difference(made / name) < 1e-3
    (check,) = (c for c in validate(made / name).checks if c.name == "light_groups")
    assert check.passed and check.figures["largest_difference"] < 1e-3


def test_each_emitter_has_a_group_of_its_own(made):
    assert json.loads((made / "emitters.json").read_text()) == [
        "World",
        "bulb",
        "bulb [library.blend]",
        "fire",
        "lamp 1",
        "lamp.1",
        "two colours",
    ]
    names = ["World", "bulb", "bulb_library_blend", "fire", "lamp_1", "lamp_1_2", "two_colours"]
    assert group_names(made / "perspective") == [f"Combined_{name}" for name in names]
    for name in group_names(made / "panorama"):
        assert colour(made / "panorama", name).any(), name


def test_named_emitters_share_a_group_and_the_others_are_the_rest(made):
    assert group_names(made / "named") == ["Combined_lamps", "Combined_rest"]
    lamps = sum(colour(made / "perspective", f"Combined_lamp_1{end}") for end in ("", "_2"))
    np.testing.assert_allclose(colour(made / "named", "Combined_lamps"), lamps, rtol=2e-3)


def test_other_strengths_are_the_scene_rendered_in_that_light(made):
    folder = made / "many_samples"
    factors = {"Combined_lamp_1": 2, "Combined_lamp_1_2": 0}
    names = group_names(folder)
    predicted = sum(factors.get(name, 1) * colour(folder, name) for name in names)
    rendered = colour(made / "relit")
    assert predicted.mean() == pytest.approx(rendered.mean(), rel=0.01)
    # The noise of 256 samples remains.
    assert np.median(np.abs(predicted - rendered) / rendered) < 0.05
    assert np.abs(colour(folder) - rendered).mean() > 4 * np.abs(predicted - rendered).mean()


def test_a_shadow_catcher_is_refused(made):
    text = (made / "refusal.txt").read_text()
    assert text.startswith("render.light_groups: floor is a shadow catcher")


# The names of groups.


def test_equal_names_are_numbered_and_do_not_depend_on_their_order():
    emitters = ["Lamp.001", "Lamp 001", "LAMP_001", "***", "rest", "x" * 60, "x" * 61]
    groups = resolved("each", emitters)
    assert groups == resolved("each", emitters[::-1])
    assert sorted(members[0] for members in groups.values()) == sorted(emitters)
    assert len({name.lower() for name in groups}) == len(emitters)
    assert all(re.fullmatch("[A-Za-z0-9][A-Za-z0-9_-]{0,39}", name) for name in groups)
    assert "rest" not in groups


def test_255_groups_are_allowed_and_more_are_refused():
    emitters = [f"lamp {number}" for number in range(255)]
    assert len(resolved("each", emitters)) == 255
    with pytest.raises(UserError, match=r"render\.light_groups: makes 256 groups, and Cycles can"):
        resolved("each", ["one more", *emitters])
    assert len(resolved({"lamps": emitters}, ["one more", *emitters])) == 2


@pytest.mark.parametrize(
    ("setting", "emitters", "problem"),
    [
        (["Lmp"], ["Lamp", "World"], "no emitter 'Lmp'; did you mean Lamp?"),
        ({"a": ["sun"]}, ["Lamp", "World"], "no emitter 'sun'; it has Lamp, World"),
        ("each", [], "has no emitter: no lamp"),
    ],
)
def test_a_name_that_the_scene_lacks_is_refused(setting, emitters, problem):
    with pytest.raises(UserError, match=re.escape(problem)):
        resolved(setting, emitters)


# Datasets of computed views: the colour is the sum of two groups.


def dataset(folder, groups=("lamp", "sky"), camera=CAMERA):
    lens = lenses.from_camera(camera)
    render = {"depth_precision": "float", "light_groups": {name: [name] for name in groups}}
    rig = {"type": "lattice", "cameras": [2, 1, 1], "size": 0.5}
    content = LightField.from_rig(rig, lens, depth=None, frame=1, render=render, scene={})
    content.write(folder / "lightfield.json")
    rays = np.nan_to_num(lens.pixel_rays())
    for number, view in enumerate(content.views):
        parts = [np.abs(np.roll(rays, shift + number, axis=2)) for shift in range(len(groups))]
        for name, part in zip(groups, parts, strict=True):
            write(folder, f"Combined_{name}", view.name, part)
        write(folder, "exr", view.name, sum(part.astype(np.float16) for part in parts))
    return content


def write(folder, name, view, pixels):
    halves = np.moveaxis(pixels.astype(np.float16), -1, 0)
    images.write_exr(folder / name / f"{view}.exr", dict(zip("RGB", halves, strict=True)))


def spoil_sum(folder):
    write(folder, "Combined_sky", "view_0001f", 1.01 * colour(folder, "Combined_sky"))


def remove_a_group(folder):
    shutil.rmtree(folder / "Combined_sky")


SPOILED = {
    spoil_sum: ("light_groups", "exr/view_0001f.exr: the sum of the light groups is off by"),
    remove_a_group: ("passes", "Combined_sky/view_0000f.exr: is missing"),
    lambda folder: write(folder, "Combined_x", "view_0000f", np.ones((16, 16, 3))): (
        "files",
        "Combined_x/view_0000f.exr: is not a file of this dataset",
    ),
}


@pytest.mark.parametrize("spoil", SPOILED)
def test_validation_finds_groups_that_are_missing_or_do_not_add_up(spoil, tmp_path):
    folder = tmp_path / "scene" / "rig"
    dataset(folder)
    checks = {check.name: check for check in validate(folder).checks}
    assert all(check.passed is not False for check in checks.values())
    assert checks["light_groups"].passed
    spoil(folder)
    name, problem = SPOILED[spoil]
    failed = {check.name: check for check in validate(folder).checks if check.passed is False}
    assert failed.keys() == {name}
    assert failed[name].problems[0].startswith(problem)


def test_light_beyond_half_floats_needs_not_add_up(tmp_path):
    """A lamp of negative light may leave a colour of 100 of a group beyond half floats."""
    folder = tmp_path / "scene" / "rig"
    dataset(folder)
    view = "view_0001f"
    for name in ("exr", "Combined_sky"):
        pixels = colour(folder, name, view=view)
        pixels[3, 4] = images.HALF_MAX if name == "Combined_sky" else 100
        write(folder, name, view, pixels)
    checks = {check.name: check for check in validate(folder).checks}
    assert checks["light_groups"].passed
    pixels[3, 4] = 60_000
    write(folder, "Combined_sky", view, pixels)
    checks = {check.name: check for check in validate(folder).checks}
    assert checks["light_groups"].passed is False


def scene(**more):
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 1, "light_groups": ["lamp", "sky"]},
        "rigs": {"one": {"type": "lattice", "cameras": [1, 1, 1], "camera": CAMERA}},
    }
    return Scene.model_validate(content | more)


@pytest.fixture
def develop(tmp_path, reproject_dataset):
    """Return a function that develops the dataset in tmp_path/rig in another light."""

    def run(name, light, check=True, **settings):
        content = {"format": "exr", "relight": light, **settings}
        # The plan resolves names to lights.
        reprojection = scene(reprojections={name: content}).developments[name]
        folder = tmp_path / "rig"
        content = reprojection.as_json()
        return reproject_dataset(folder, folder / name, content, check=check)

    return run


def test_a_light_weighs_each_group_and_colour(develop, tmp_path):
    folder = tmp_path / "rig"
    dataset(folder)
    develop("night", {"lamp": 0, "sky": [0.5, 1, 3]})
    expected = colour(folder, "Combined_sky") * [0.5, 1, 3]
    seen = np.isfinite(lenses.from_camera(CAMERA).pixel_rays())
    np.testing.assert_allclose(colour(folder, "night")[seen], expected[seen], rtol=1e-3)
    settings = json.loads((folder / "night/lightfield.json").read_text())["reprojection"]
    assert settings["relight"] == {"lamp": 0, "sky": [0.5, 1, 3]}
    develop("dim", {"lamp": 0.1}, format="png", bits=16, exposure=0)
    linear = 0.1 * colour(folder, "Combined_lamp") + colour(folder, "Combined_sky")
    picture = images.read_image(folder / "dim/view_0000f.png").colour / 65535
    np.testing.assert_allclose(picture[seen], encode_srgb(linear)[seen], atol=1e-4)
    assert validate(folder, ["night", "dim"]).valid


def test_one_light_at_a_time_makes_an_image_for_each_group(develop, tmp_path):
    folder = tmp_path / "rig"
    dataset(folder)
    # This lamp reaches nothing that the view shows.
    write(folder, "exr", "view_0000f", colour(folder, "Combined_sky"))
    write(folder, "Combined_lamp", "view_0000f", np.zeros((16, 16, 3)))
    develop("olat", "each")
    names = [path.name for path in sorted((folder / "olat").glob("*.exr"))]
    assert names == [
        "view_0000f_lamp.exr",
        "view_0000f_sky.exr",
        "view_0001f_lamp.exr",
        "view_0001f_sky.exr",
    ]
    seen = np.isfinite(lenses.from_camera(CAMERA).pixel_rays())
    for view in ("view_0000f", "view_0001f"):
        for group in ("lamp", "sky"):
            alone = colour(folder, "olat", f"{view}_{group}")
            expected = colour(folder, f"Combined_{group}", view)
            np.testing.assert_array_equal(alone[seen], expected[seen])
    frames = json.loads((folder / "olat/lightfield.json").read_text())["frames"]
    assert [frame["light"] for frame in frames] == ["lamp", "sky"] * 2
    assert validate(folder, ["olat"]).valid


def test_groups_are_reprojected_with_the_colour(develop, tmp_path):
    folder = tmp_path / "rig"
    dataset(folder)
    perspective = {"lens": "rectilinear", "fov": 60, "resolution": [12, 12]}
    for name, kind in (("flat", "bilinear"), ("smooth", "adaptive")):
        develop(name, {}, camera=perspective, filter=kind)
    assert validate(folder, ["flat", "smooth"]).valid


def sparks(folder, content):
    """Give the views two groups of sharp lights, whose sum filters change."""
    rng = np.random.default_rng(0)
    for view in content.views:
        lamp, sky = (rng.pareto(0.5, (16, 16, 3)).clip(0, 1000) for _ in range(2))
        sky *= rng.random((16, 16, 3)) < 0.2
        write(folder, "Combined_lamp", view.name, lamp)
        write(folder, "Combined_sky", view.name, sky)
        write(folder, "exr", view.name, lamp + sky)


@pytest.mark.parametrize("filter_name", FILTERS)
@pytest.mark.parametrize("fov", [60, 140])
def test_reprojected_groups_add_up_with_every_filter(filter_name, fov, tmp_path, reproject_dataset):
    folder = tmp_path / "rig"
    sparks(folder, dataset(folder))
    camera = {"lens": "rectilinear", "fov": fov, "resolution": [12, 12]}
    reprojection = {"format": "exr", "camera": camera, "passes": ["light_groups"]}
    content = scene(reprojections={"flat": reprojection | {"filter": filter_name}})
    settings = content.developments["flat"]
    reproject_dataset(folder, folder / "flat", settings.as_json())
    for view in ("view_0000f", "view_0001f"):
        seen = colour(folder, "flat", view)
        groups = [colour(folder / "flat", f"Combined_{name}", view) for name in ("lamp", "sky")]
        for group in groups:
            assert (group >= np.minimum(seen, 0)).all()
        assert (np.abs(sum(groups) - seen) / np.maximum(np.abs(seen), 1e-3)).max() < 1e-3
    result = validate(folder, ["flat"])
    (check,) = (check for check in result.checks if check.name == "flat/light_groups")
    assert result.valid and check.passed


def test_a_light_of_unknown_groups_is_refused_before_it_is_developed(develop, tmp_path):
    dataset(tmp_path / "rig", groups=("bulb", "fire"))
    result = develop("night", {"lamp": 0}, check=False)
    assert result.returncode and result.stderr.count("\n") == 1
    assert "relight: there is no light group 'lamp'; there are bulb, fire" in result.stderr
    assert not list((tmp_path / "rig/night").glob("*.exr"))


# The scene YAML.


def test_each_entry_of_relight_is_a_development_of_its_own():
    content = scene(
        relight={"night": {"lamp": 0}, "olat": "each"},
        reprojections={"flat": {"relight": "night", "exposure": 1}},
    )
    assert [*content.reprojections] == ["flat", "night", "olat"]
    assert [each.relight for each in content.developments.values()] == [
        {"lamp": 0},
        {"lamp": 0},
        "each",
    ]
    assert content.reprojections["night"].format == "exr"


def test_names_are_those_of_the_groups():
    assert names_in("each") is None and names_in(None) is None
    assert names_in(["Lamp.001", "World"]) == ["World", "Lamp_001"]
    assert names_in({"all": ["a", "b"]}) == ["all"]


def test_settings_without_light_groups_are_as_before():
    plain = scene(render={"samples": 1}, reprojections={"flat": {}})
    assert "light_groups" not in plain.render.model_dump(exclude_none=True)
    settings = plain.developments["flat"]
    assert "relight" not in settings.as_json() and "relight" not in settings.development(None)


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ({"relight": {"night": {"lmp": 0}}}, "relight.night: there is no light group 'lmp'; did "),
        ({"relight": {"each": {}}}, "relight.each: the name each is taken"),
        ({"reprojections": {"flat": {"relight": "nigt"}}, "relight": {"night": {}}}, "mean night?"),
        (
            {"relight": {"olat": "each"}, "exports": {"colmap": {"sources": ["olat"]}}},
            "exports.colmap.sources: olat holds one image per light",
        ),
        (
            {"reprojections": {"olat": {"relight": "each", "passes": ["light_groups"]}}},
            "reprojections.olat.passes: does not go with the light each",
        ),
        (
            {"relight": {"night": {}}, "sensor": {"sources": ["night"]}},
            "sensor.sources: night has relight; name one without",
        ),
        ({"reprojections": {"Combined_lamp": {}}}, "the name Combined_lamp is taken"),
    ],
)
def test_impossible_lights_are_refused(more, problem):
    with pytest.raises(ValueError, match=re.escape(problem)):
        scene(**more)


# The plan.


def write_scene(folder, monkeypatch, reprojections=None, **render):
    """Write a scene YAML into a user's own folder, and return its only dataset."""
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 8, "light_groups": "each", **render},
        "rigs": {"LFOne": {"type": "lattice", "cameras": [2, 1, 1], "camera": CAMERA}},
        "relight": {"olat": "each"},
        "reprojections": reprojections or {},
    }
    path = folder / "configs/scenes/lit.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(content))
    monkeypatch.chdir(folder)
    (dataset,) = scene_datasets("lit", "full", Preset(denoise=True))
    return dataset


def test_a_preset_does_not_denoise_light_groups(tmp_path, monkeypatch):
    assert write_scene(tmp_path, monkeypatch).render.denoise is False


def test_more_groups_need_more_memory_and_more_disk_space(tmp_path, monkeypatch):
    few, many = (
        write_scene(tmp_path, monkeypatch, light_groups=[f"lamp {n}" for n in range(count)])
        for count in (1, 100)
    )
    pixels = 16**2
    rendered = [rendering(dataset, views=1) for dataset in (few, many)]
    more_memory = rendered[1].memory_bytes - rendered[0].memory_bytes
    # At least Cycles' own buffers and halves.
    assert more_memory > 99 * 12 * pixels
    assert rendered[1].disk_bytes > 10 * rendered[0].disk_bytes
    beside = [
        view_cost(dataset).disk_bytes - each.disk_bytes
        for dataset, each in zip((few, many), rendered, strict=True)
    ]
    assert beside[1] > 10 * beside[0]


def test_a_moving_camera_is_planned_to_take_longer(tmp_path, monkeypatch):
    motion = {"travel": [0.1, 0, 0]}
    still, moving = (
        view_cost(write_scene(tmp_path, monkeypatch, **more)).seconds
        for more in ({}, {"camera_motion": motion})
    )
    assert 1.05 * still < moving < 1.5 * still


def test_reprojected_groups_take_time_and_disk_space(tmp_path, monkeypatch):
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [16, 16]}
    without, with_groups = (
        write_scene(
            tmp_path,
            monkeypatch,
            {"flat": {"format": "exr", "camera": camera, **more}},
            light_groups=[f"lamp {number}" for number in range(10)],
        )
        for more in ({}, {"passes": ["light_groups"]})
    )
    # Half floats of three channels, of ten groups and the rest.
    added = view_cost(with_groups).disk_bytes - view_cost(without).disk_bytes
    assert 0.5 * 11 * 6 * 16**2 < added <= 11 * 6 * 16**2
    # So many views that the start of the job hardly counts.
    views = 10**6
    seconds = [reprojecting(each, "flat", views).seconds for each in (without, with_groups)]
    assert seconds[1] > 11 * seconds[0]


@pytest.fixture
def make_lightfield(tmp_path, monkeypatch, run_program):
    """Return a function that runs make_lightfield.py on a scene with a group for each emitter."""

    def run(*arguments, check=True, **keys):
        dataset = write_scene(tmp_path, monkeypatch)
        path = tmp_path / "settings.json"
        write_json(path, LightfieldSettings.of_capture(dataset, **keys).as_json())
        output = tmp_path / "lightfield.json"
        arguments = ("--settings", path, "--output", output, *arguments)
        result = run_program("make_lightfield.py", *arguments, check=check, cwd=tmp_path)
        return json.loads(output.read_text())["render"] if output.exists() else result.stderr

    return run


def test_lightfield_json_names_the_emitters_of_each_group(make_lightfield, tmp_path):
    write_json(tmp_path / "inventory.json", {"emitters": ["World", "Lamp.001"]})
    render = make_lightfield("--inventory", tmp_path / "inventory.json")
    assert render["light_groups"] == {"World": ["World"], "Lamp_001": ["Lamp.001"]}


def test_light_groups_need_an_inventory_that_lists_the_emitters(make_lightfield, tmp_path):
    message = "--inventory: is missing; scripts/inventory.py names the light groups"
    assert message in make_lightfield(check=False)
    write_json(tmp_path / "inventory.json", {})
    assert "emitters" in make_lightfield("--inventory", tmp_path / "inventory.json", check=False)


def test_a_panorama_of_the_page_has_no_light_groups(make_lightfield):
    assert "light_groups" not in make_lightfield(panorama_width=64)


def test_a_light_group_of_another_size_is_refused(develop, tmp_path):
    folder = tmp_path / "rig"
    dataset(folder)
    write(folder, "Combined_sky", "view_0000f", np.ones((8, 8, 3)))
    result = develop("night", {"lamp": 0}, check=False)
    assert result.returncode and "Traceback" not in result.stderr
    assert "Combined_sky/view_0000f.exr" in result.stderr
