"""Pages, pictures, thumbnails and cards of a scene whose pictures have one of Blender's looks."""

import base64
import io
import json
import math
import tarfile

import numpy as np
import pytest
import yaml
from conftest import SMALL_WALK
from PIL import Image
from sphere import look_at_ball, write_views
from test_walk import EYE, RIG, look_from, matrix_of, psnr, wait

from lightfield.configuration.publication import Credits
from lightfield.configuration.scene_yaml import Scene
from lightfield.configuration.shown_look import ShownLook, shown_look
from lightfield.core.files import sha256, write_json
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.imaging import images
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.look import Look
from lightfield.publishing import package
from lightfield.publishing.publish import publish
from lightfield.reading.dataset import OpenDataset
from lightfield.report import dataset_page
from lightfield.stages.report import FiguresSettings, PageSettings, ReportFigures, ReportHtml
from lightfield.synthesis.view import Sources, reader
from lightfield.validation.verification import faults

PUNCHY = ShownLook(name="AgX - Punchy", exposure=0.5)
SMALL = {**RIG, "subdivisions": 1, "camera": {**RIG["camera"], "resolution": [64, 64]}}


def write_dataset(folder, rig):
    write_views(folder, rig["camera"], rig, see=look_at_ball)
    field = LightField.read(folder / "lightfield.json")
    field.changed(frame=1, scene={"name": "ball"}, render={"samples": 1}).write(field.path)
    return folder


def write_reprojection(folder, lens=None, **keys):
    """Write lightfield.json of a reprojection of a dataset, and its pictures: all are grey."""
    field = LightField.read(folder.parent / "lightfield.json")
    field.changed(lens=lens or field.lens, reprojection=keys).write(folder / "lightfield.json")
    for view in field.views:
        images.write_png(folder / f"{view.name}.png", np.full((8, 8, 3), 128, np.uint8))


def finish(folder):
    """Make a dataset valid, so that it can be published."""
    write_json(folder / "validation.json", {"valid": True, "checks": []})
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    sums = [f"{sha256(path)}  {path.relative_to(folder)}\n" for path in files]
    (folder / "sha256sums.txt").write_text("".join(sums))


def make_page(folder, rig, look=PUNCHY):
    settings = PageSettings.of(rig=rigs.from_settings(rig), yaml="", command="snakemake", look=look)
    output = folder / "report/index.html"
    ReportHtml(settings=settings, dataset=folder, dataset_name="ball/sphere", output=output).run()
    return output


def developed(light):
    """What Blender's own OpenColorIO makes of light (h, w, 3), in sRGB from 0 to 1."""
    return Look.of("AgX - Punchy", 0.5).developed(np.nan_to_num(light))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("look") / "dataset", RIG)


def canvas_of(opened, name):
    uri = opened.evaluate("(id) => element(id).toDataURL('image/png')", name)
    return Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert("RGB")


def test_the_walk_and_the_open_view_have_the_look(folder, show):
    opened = show(make_page(folder, RIG), walk_scale=SMALL_WALK)
    wait(opened)
    source, lens = OpenDataset.in_folder(folder), lenses.from_camera(EYE)
    field = Sources(source.lens, source.lightfield.views, reader(source), most=99)
    place, yaw, pitch = np.array([0.1, 0.05, -0.1]), 0.2, -0.1
    shown = look_from(opened, place.tolist(), yaw, pitch)
    made = field.synthesise(matrix_of(place, yaw, pitch), lens, 6)
    assert psnr(shown, developed(made.colour)) >= 35
    # The open view. Outside the image circle it is transparent.
    name = opened.inner_text("#view-name")
    view = np.asarray(canvas_of(opened, "viewer"), float) / 255
    light = images.read_image(folder / f"exr/{name}.exr").colour
    inside = np.isfinite(source.lens.pixel_rays()[..., 0])
    off = np.abs(view - developed(light))[inside]
    assert np.median(off) < 2 / 255
    assert off.mean() < 3 / 255
    assert "AgX - Punchy" in opened.inner_text("#explore")
    # The slider changes light before the look.
    opened.evaluate(
        "element('exposure').value = 1; element('exposure').dispatchEvent(new Event('input'))"
    )
    brighter = look_from(opened, place.tolist(), yaw, pitch)
    assert psnr(brighter, developed(2 * made.colour)) >= 35


def test_the_overview_and_the_contact_sheet_have_the_look(tmp_path):
    folder = write_dataset(tmp_path / "dataset", SMALL)
    settings = FiguresSettings.of(rig=rigs.from_settings(SMALL), look=PUNCHY)
    ReportFigures(settings=settings, dataset=folder, output=tmp_path / "report").run()
    names = [view.name for view in LightField.read(folder / "lightfield.json").views]
    overview = images.read_image(tmp_path / "report/overview.png").srgb.astype(float)
    light = [images.read_image(folder / f"exr/{name}.exr").colour for name in names]
    inside = np.isfinite(lenses.from_camera(SMALL["camera"]).pixel_rays()[..., 0])
    off = [np.abs(overview - 255 * developed(view))[inside].max() for view in light]
    assert min(off) <= 1
    # Each view is on the sheet somewhere in the row of its name: compare the mean colours.
    sheet = images.read_image(tmp_path / "report/contact_sheet.png").srgb
    first = sheet[4:100, 4:100].reshape(96, 96, 3)[::4, ::4].astype(float)
    centre = 255 * developed(light[0])[32, 32]
    assert np.abs(first[12, 12] - centre).max() < 6


def test_only_another_lens_is_called_another_lens(tmp_path, show):
    folder = write_dataset(tmp_path / "dataset", SMALL)
    field = LightField.read(folder / "lightfield.json")
    look = Look.of("AgX - Punchy", 0.5).to_json()
    write_reprojection(folder / "pictures", look=look)
    write_reprojection(folder / "plain")
    write_reprojection(folder / "narrow", lenses.from_camera(EYE), look=look)
    listed = dict(dataset_page.files(folder, field, valid=True))
    assert "lens" not in listed["pictures/"]
    assert "AgX - Punchy" in listed["pictures/"]
    assert "lens" not in listed["plain/"]
    assert "another lens" in listed["narrow/"]
    assert "AgX - Punchy" in listed["narrow/"]
    opened = show(make_page(folder, SMALL))
    captions = opened.locator("#views figcaption").all_inner_texts()
    (pictures,) = (text for text in captions if text.startswith("pictures/"))
    assert "another lens" not in pictures
    assert "AgX - Punchy" in pictures


def test_thumbnails_have_the_look(tmp_path):
    folder = write_dataset(tmp_path / "dataset", SMALL)
    finish(folder)
    publish(folder, "ball", published_scene(), tmp_path / "ball", None, look=PUNCHY)
    (tar,) = (tmp_path / "ball").glob("ball-*.tar")
    with tarfile.open(tar) as archive:
        names = [name for name in archive.getnames() if name.endswith("thumbnail.jpg")]
        picture = Image.open(io.BytesIO(archive.extractfile(names[0]).read()))
    light = images.read_image(folder / f"exr/{names[0].split('.')[0]}.exr").colour
    off = np.asarray(picture, float)[8:-8, 8:-8] - 255 * developed(light)[8:-8, 8:-8]
    assert np.median(np.abs(off)) < 4


def published_scene():
    return Credits.model_validate({"description": "A ball", "licence": "CC0-1.0", "publish": {}})


def test_card_and_croissant_name_the_look_of_each_folder(tmp_path):
    folder = write_dataset(tmp_path / "dataset", SMALL)
    write_reprojection(folder / "pictures", look=Look.of("AgX - Punchy", 0.5).to_json())
    write_reprojection(folder / "plain")
    manifest = {"format": "poses_csv", "look": Look.of("Filmic", 0).to_json()}
    write_json(folder / "exports/poses_csv/export.json", manifest)
    finish(folder)
    card = package.card(folder, "ball", published_scene())
    assert card["looks"] == {"exports/poses_csv": "Filmic", "pictures": "AgX - Punchy"}
    (archive,) = package.pack(folder, card, tmp_path / "ball.tar", None)
    with tarfile.open(archive) as tar:
        readme = tar.extractfile("ball/README.md").read().decode()
    (row,) = (line for line in readme.splitlines() if line.startswith("| looks"))
    assert "`pictures/`: AgX - Punchy" in row
    publish(folder, "ball", published_scene(), tmp_path / "published", None)
    readme = (tmp_path / "published/README.md").read_text()
    assert "`pictures.png`: AgX - Punchy" in readme
    content = json.loads((tmp_path / "published/croissant.json").read_text())
    described = {each["@id"]: each.get("description", "") for each in content["distribution"]}
    assert "AgX - Punchy" in described["files-pictures.png"]
    assert "sRGB" in described["files-plain.png"]
    assert "AgX" not in described["files-plain.png"]


def test_a_package_has_the_walk_of_its_page(tmp_path):
    folder = write_dataset(tmp_path / "dataset", SMALL)
    finish(folder)
    make_page(folder, SMALL)
    card = package.card(folder, "ball", published_scene())
    (archive,) = package.pack(folder, card, tmp_path / "ball.tar", None)
    with tarfile.open(archive) as tar:
        names = tar.getnames()
        tar.extractall(tmp_path / "unpacked", filter="data")
    assert "ball/walk.html" in names
    assert not [name for name in names if "report/" in name]
    # It belongs to the package, and is no stray file of the dataset.
    assert faults(tmp_path / "unpacked") == {}


def test_a_card_without_looks_says_nothing_of_them(tmp_path):
    folder = write_dataset(tmp_path / "dataset", SMALL)
    assert "looks" not in package.card(folder, "ball", published_scene())


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        ("exports: {nerfstudio: {sources: [views], look: AgX, exposure: 1}}", ("AgX", 1)),
        ("reprojections: {png: {look: Filmic}, more: {look: AgX}}", ("Filmic", 0)),
        ("reprojections: {png: {}}", None),
        ("sensor: {sources: [views], look: AgX, exposure: 2}", ("AgX", 0)),
    ],
    ids=["export", "reprojection", "none", "sensor"],
)
def test_the_first_look_of_a_scene_is_shown(blocks, expected):
    text = (
        "scene: {builder: room}\nrender: {samples: 4}\n"
        "rigs: {line: {type: plane, cameras: [2, 1], size: 1, "
        "camera: {lens: rectilinear, fov: 50, resolution: [32, 32]}}}\n"
    )
    scene = Scene.model_validate(yaml.safe_load(text + blocks))
    look = shown_look(scene.developments.values(), scene.exports.selected.values())
    assert (look and (look.name, look.exposure)) == expected


def test_the_look_of_the_file_is_read_from_the_dataset(folder):
    own = Look("AgX", exposure=1.0)
    field = LightField.read(folder / "lightfield.json").changed(**{FILE_LOOK: own.to_json()})
    look = ShownLook(name="file", exposure=0.5).resolved(field)
    assert look.view == "AgX"
    assert math.isclose(look.exposure, 1.5)
