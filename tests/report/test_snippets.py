"""The code on a page, on a package's card and in the first tutorial runs as it is printed."""

import contextlib
import html
import importlib.util
import io
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh
from checkouts import ROOT
from reading.test_reading import CREDITS
from test_report_html import SPHERE, make_page, write_dataset

from lightfield.configuration.publication import Credits
from lightfield.core.files import sha256, write_json
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.publishing import package
from lightfield.publishing.publish import publish

FRAMES = ("f00001", "f00002", "f00003")
TUTORIAL = ROOT / "docs/tutorials/first-dataset.md"


@dataclass(frozen=True)
class Built:
    """A rig's folder, and the dataset in it: one of its frames, if it is a sequence."""

    rig: Path
    dataset: Path
    is_transparent: bool


@pytest.fixture(params=["opaque", "transparent", "sequence", "normals", "no depth"])
def built(request, tmp_path, monkeypatch):
    """A finished rig's folder in the place of the one in the tutorial."""
    monkeypatch.chdir(tmp_path)
    rig = tmp_path / "results/garden_preview/LFSphere_e100cm_d170cm"
    frames = [rig / name for name in FRAMES] if request.param == "sequence" else [rig]
    for folder in frames:
        write_dataset(folder, SPHERE)
        if request.param == "transparent":
            make_transparent(folder)
        if request.param == "normals":
            add_normals(folder)
        if request.param == "no depth":
            remove_depth(folder)
        (folder / "exports/poses_csv").mkdir(parents=True)
        (folder / "exports/poses_csv/poses.csv").write_text("name,x\nview_0000f,1\n")
        write_json(folder / "exports/poses_csv/export.json", {"format": "poses_csv"})
    if request.param == "sequence":
        add_sequence_export(rig)
    else:
        (rig / "mesh").mkdir()
        trimesh.creation.box().export(rig / "mesh/scene.glb")
        write_json(rig / "mesh/export.json", {"format": "mesh"})
        write_json(rig / "video/export.json", {"format": "video"})
        (rig / "video/walk.webp").write_text("stands in for a walk")
    for folder in frames:
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        lines = [f"{sha256(path)}  {path.relative_to(folder)}\n" for path in files]
        (folder / "sha256sums.txt").write_text("".join(lines))
    return Built(rig, frames[0], request.param == "transparent")


def make_transparent(folder):
    path = folder / "lightfield.json"
    lightfield = LightField.read(path)
    render = lightfield.render
    lightfield.changed(render=render.changed(transparent=True).to_json()).write(path)
    for view in folder.glob("exr/*.exr"):
        image = images.read_image(view)
        channels = dict(zip("RGB", np.moveaxis(image.colour, -1, 0), strict=True))
        channels |= {"A": np.ones_like(image.colour[..., 0]), "Z": image.channels["Z"]}
        images.write_exr(view, channels)


def add_normals(folder):
    path = folder / "lightfield.json"
    lightfield = LightField.read(path)
    lightfield.changed(render=lightfield.render.changed(passes=["normal"]).to_json()).write(path)
    for view in folder.glob("exr/*.exr"):
        plane = np.zeros((64, 64), np.float32)
        images.write_exr(folder / "normal" / view.name, dict.fromkeys("RGB", plane))


def remove_depth(folder):
    path = folder / "lightfield.json"
    LightField.read(path).changed(depth=None).write(path)
    for view in folder.glob("exr/*.exr"):
        channels = images.read_image(view).channels
        images.write_exr(view, {name: channels[name] for name in "RGB"})


def add_sequence_export(rig):
    """Write a scene flow, in which each frame but the last has a folder."""
    flow = {name: np.zeros((4, 4), np.float32) for name in "XYZV"}
    for name in FRAMES[:-1]:
        for view in (rig / name / "exr").iterdir():
            images.write_exr(rig / "exports/scene_flow" / name / view.name, flow)
    write_json(rig / "exports/scene_flow/export.json", {"format": "scene_flow"})


def run(code):
    """Run Python code. Return its variables and what it prints."""
    names, printed = {}, io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, names)
    return names, printed.getvalue()


def channel_names(view):
    return "".join(oiio.ImageBuf(str(view)).spec().channelnames)


def test_the_card_s_code_runs_where_the_package_is_unpacked(built, tmp_path, monkeypatch):
    card = package.card(built.rig, "garden_LFSphere", Credits())
    (archive,) = package.pack(built.rig, card, tmp_path / "garden_LFSphere.tar", None)
    (tmp_path / "unpacked").mkdir()
    subprocess.run(["tar", "-xf", archive, "-C", tmp_path / "unpacked"], check=True)
    monkeypatch.chdir(tmp_path / "unpacked/garden_LFSphere")
    readme = Path("README.md").read_text()
    loaders = re.findall(r"^`(\S+)`\n\n```\n(.*?)\n```$", readme, re.M | re.S)
    # A sequence has no mesh here, and no video.
    assert len(loaders) == len(card["loaders"]) == (2 if built.rig != built.dataset else 3)
    for place, code in loaders:
        assert Path(place).exists()
        module = code.split()[1]
        assert importlib.util.find_spec(module), module
        run(code)
    (check,) = re.findall(r"`(sha256sum -c .*?)`", readme)
    folders = FRAMES if built.rig != built.dataset else ["."]
    for folder in folders:
        subprocess.run(check.split(), cwd=folder, check=True, stdout=subprocess.DEVNULL)
    (code,) = re.findall(r"```python\n(.*?)```", readme, re.S)
    assert code.strip() == card["python"]
    monkeypatch.chdir("..")
    check_reading(code, built)
    count = "12 at each of 3 frames" if built.rig != built.dataset else "12"
    assert f"| views | {count}, " in readme
    assert f"| transparent | {'yes: channel A' if built.is_transparent else 'no'}" in readme


def check_reading(code, built):
    """Run code that reads a dataset. It must name all arrays that a view has, and only these."""
    names, _ = run(code)
    view = names["view"]
    assert view.rgb.shape == (64, 64, 3)
    (arrays,) = re.findall(r"^(view\.rgb.*?)  #", code, re.M)
    told = {array.removeprefix("view.") for array in arrays.split(", ")}
    channels = channel_names(next(built.dataset.glob("exr/*.exr")))
    there = {"rgb"} | {{"A": "alpha", "Z": "depth"}[each] for each in channels[3:]}
    if (built.dataset / "normal").is_dir():
        there.add("normal")
    assert told == there
    assert names["origins"].shape == names["directions"].shape == (64, 64, 3)
    assert names["pixels"].shape == (1, 2)
    assert names["visible"].shape == (1,)


def test_the_published_readme_s_code_reads_the_shards(built, tmp_path, monkeypatch):
    folder = tmp_path / "published/garden_LFSphere"
    publish(built.rig, folder.name, Credits.model_validate(CREDITS), folder, None)
    readme = (folder / "README.md").read_text()
    (code,) = re.findall(r"```python\n(from lightfield.*?)```", readme, re.S)
    monkeypatch.chdir(folder.parent)
    check_reading(code, built)


def test_the_page_s_code_reads_the_arrays_that_it_names(built, monkeypatch):
    name = built.rig.relative_to(Path("results").resolve()).as_posix()
    page = make_page(built.dataset, SPHERE, name=name).read_text()
    (code,) = re.findall(r"<pre><code>(from lightfield.*?)</code>", page, re.S)
    monkeypatch.chdir("results")
    check_reading(html.unescape(code), built)


@pytest.mark.parametrize("built", ["opaque", "transparent", "sequence"], indirect=True)
def test_the_tutorial_s_code_prints_colour_and_depth(built):
    (code,) = re.findall(
        r"^PYTHONPATH=scripts python - << 'END'\n(.*?)^END$", TUTORIAL.read_text(), re.M | re.S
    )
    folder = "results/garden_preview/LFSphere_e100cm_d170cm"
    assert folder in code
    code = code.replace(folder, built.dataset.relative_to(Path.cwd()).as_posix())
    _, printed = run(code)
    view = oiio.ImageBuf(str(built.dataset / "exr/view_0000f.exr"))
    pixel = view.getpixel(view.spec().width // 2, view.spec().height // 2)
    colour, depth = pixel[:3], pixel[-1]
    assert "colour {:.3f} {:.3f} {:.3f}, depth {:.3f} m".format(*colour, depth) in printed
