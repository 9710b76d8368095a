"""scripts/diff.py says why two datasets differ. The datasets were built, and then changed."""

import json
import re
import shutil
import subprocess

import checkouts
import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest
import tiny
from skimage.metrics import peak_signal_noise_ratio

from lightfield.core.names import ROOT
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.measurement.dataset_facts import changed_poses

VIEW = "exr/view_0003f.exr"
PNG = "perspective/view_0002f.png"
FIRST = "settings", "inputs", "files", "pixels"


@pytest.fixture
def pair(built_tiny, tmp_path):
    """A built dataset in its place, and a copy of it elsewhere."""
    dataset = built_tiny / "results" / tiny.NAME
    return dataset, shutil.copytree(dataset, tmp_path / "copy")


@pytest.fixture
def diff(run_program):
    """Run the program. Return its exit status, its lines, and its errors."""

    def run(a, b):
        result = run_program("diff.py", a, b, check=False)
        return result.returncode, result.stdout.splitlines(), result.stderr

    return run


def darker(rows):
    """Return a change of an image: some rows in its middle become black."""

    def change(planes):
        planes["R"][10 : 10 + rows] = 0

    return change


def section(lines, title):
    """Return the lines below a title."""
    start = next(number for number, line in enumerate(lines) if line.startswith(title))
    below = "\n".join(lines[start + 1 :]).partition("\n\n")[0]
    return [line.strip() for line in below.splitlines()]


def rewritten(path, change=lambda planes: None, **header):
    """Write an EXR again by OpenEXR alone. ``change`` changes its planes. Return old and new."""
    old = {name: part.pixels for name, part in OpenEXR.File(str(path), True).channels().items()}
    new = {name: plane.copy() for name, plane in old.items()}
    change(new)
    first = OpenEXR.File(str(path), True).header()
    OpenEXR.File({**first, **header}, dict(new)).write(str(path))
    return old, new


def test_equal_copies_are_equal_also_as_a_package(pair, diff, run_program, tmp_path):
    dataset, copy = pair
    status, lines, _ = diff(dataset, copy)
    assert (status, len(lines)) == (0, 1) and lines[0].startswith("equal: ")
    package = tmp_path / "tiny_LFPlane.tar"
    run_program("package.py", "--folder", dataset, "--output", package, "--scene", "smoke")
    (tmp_path / "unpacked").mkdir()
    subprocess.run(["tar", "-xf", package, "-C", tmp_path / "unpacked"], check=True)
    status, lines, _ = diff(dataset, tmp_path / "unpacked/tiny_LFPlane")
    assert (status, len(lines)) == (0, 1)


def test_a_changed_pixel_is_found_with_its_place_and_size(pair, diff):
    dataset, copy = pair

    def change(planes):
        planes["G"][7, 12] += 0.25
        planes["B"][8, 13] -= 0.125
        planes["Z"][12, 11] += 0.5
        planes["Z"][12, 13] = np.inf
        planes["Z"][13, 13] = np.nan

    old, new = rewritten(copy / VIEW, change)
    status, lines, _ = diff(dataset, copy)
    assert status == 1
    assert lines[0].startswith("the views differ because B has damaged files, such as " + VIEW)
    assert "settings" not in lines and "inputs" not in lines
    (file,) = section(lines, "files with other bytes: 1 of ")
    assert file.startswith(f"{VIEW}: ")
    (line,) = section(lines, "pixels in exr")
    size = new["G"][7, 12] - old["G"][7, 12]
    assert f"colour differs in 2 pixels, at most by {size:.3g} in G at (12, 7)" in line
    assert "depth differs in 3 pixels, at most by 0.5 m at (11, 12)" in line
    assert "→ inf at (13, 12), 2 pixels like that" in line
    # The standard's formula, and scikit-image.
    shown = [np.clip(np.stack([p[c] for c in "RGB"], -1).astype(float), 0, 1) for p in (old, new)]
    encoded = [np.where(s <= 0.0031308, 12.92 * s, 1.055 * s ** (1 / 2.4) - 0.055) for s in shown]
    psnr = peak_signal_noise_ratio(*encoded, data_range=1)
    assert f"PSNR {psnr:.1f} dB" in line
    assert 0 < float(re.search(r"FLIP ([\d.e-]+)", line)[1]) < 0.1
    # An unfinished dataset has no list that could say what is damaged.
    (copy / "sha256sums.txt").unlink()
    status, lines, _ = diff(dataset, copy)
    assert status == 1 and lines[0].startswith("the views differ, but all settings and inputs")
    assert "bpy 5" in lines[0]


def test_a_changed_png_is_compared_in_its_levels(pair, diff):
    dataset, copy = pair
    picture = oiio.ImageBuf(str(copy / PNG))
    pixels = picture.get_pixels(oiio.UINT8)
    other = pixels.copy()
    other[5, 9, 2] ^= 64
    changed = oiio.ImageBuf(picture.spec())
    changed.set_pixels(oiio.ROI.All, other)
    changed.write(str(copy / PNG))
    status, lines, _ = diff(dataset, copy)
    assert status == 1
    (line,) = section(lines, "pixels in perspective")
    assert "1 pixel, at most by 64 of 255 in B at (9, 5)" in line
    assert f"PSNR {peak_signal_noise_ratio(pixels, other):.1f} dB" in line


def test_equal_pixels_in_other_bytes_are_no_difference_of_pixels(pair, diff):
    dataset, copy = pair
    rewritten(copy / VIEW, compression=OpenEXR.PIZ_COMPRESSION)
    status, lines, _ = diff(dataset, copy)
    assert status == 1
    assert lines[0] == "equal pixels; only how the files are written differs"
    assert section(lines, "pixels in exr") == ["view_0003f.exr: equal pixels, other coding"]
    rewritten(copy / VIEW, **{"plenoforge:machine": "Another"})
    _, lines, _ = diff(dataset, copy)
    assert "other header: plenoforge:machine: " in section(lines, "pixels in exr")[0]
    assert section(lines, "inputs")[0].startswith("machine: ")


def test_a_missing_view_and_a_missing_reprojection_are_named(pair, diff):
    dataset, copy = pair
    (copy / VIEW).unlink()
    assert diff(dataset, copy)[1][0] == f"B lacks 1 file of A, such as {VIEW}"
    assert diff(copy, dataset)[1][0] == f"A lacks 1 file of B, such as {VIEW}"
    shutil.copy(dataset / VIEW, copy / VIEW)
    shutil.rmtree(copy / "perspective")
    _, lines, _ = diff(dataset, copy)
    assert "reprojections.perspective: only in A" in section(lines, "settings")
    assert lines[0].startswith("the images in perspective differ because reprojections.perspective")


def test_the_worst_images_come_first_and_ten_lines_at_most(pair, diff):
    dataset, copy = pair
    for number in range(6):
        rewritten(copy / f"exr/view_000{number}f.exr", darker(rows=6 - number))
    for number in range(12):
        (copy / f"note_{number:02d}.txt").write_text("x")
    _, lines, _ = diff(dataset, copy)
    order = [line[:10] for line in section(lines, "pixels in exr")]
    assert order == [f"view_000{number}f" for number in range(6)]
    assert section(lines, "files only in B: 12")[-1] == "and 2 more"


def test_a_cut_view_is_the_cause_also_without_checksums(pair, diff):
    dataset, copy = pair
    (copy / "sha256sums.txt").unlink()
    (copy / VIEW).write_bytes((dataset / VIEW).read_bytes()[:300])
    assert (
        diff(dataset, copy)[1][0] == f"the views differ because B has damaged files, such as {VIEW}"
    )
    assert "because A has damaged files" in diff(copy, dataset)[1][0]


def planes(folder, name, **channels):
    """Write a file of a pass by OpenEXR alone."""
    path = folder / name
    path.parent.mkdir()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def test_passes_are_compared_by_what_they_hold(pair, diff):
    """Objects have numbers, of which no difference has a meaning. Flow is in pixels."""
    dataset, copy = pair
    dataset = shutil.copytree(dataset, copy.with_name("with_passes"))
    zeros = np.zeros((4, 6), np.float32)
    for folder, change in ((dataset, 0), (copy, 1)):
        changed = zeros.copy()
        changed[2, 5] = 0.5 * change
        planes(folder, "normal/view_0000f.exr", R=zeros, G=changed, B=zeros)
        flow = changed.copy()
        flow[0, 1] = np.nan if change else 0
        planes(folder, "flow/view_0000f.exr", X=flow, Y=zeros, V=zeros)
        numbers = np.full((4, 6), 3, np.uint32)
        numbers[3, :2] += change
        planes(folder, "object/view_0000f.exr", Y=numbers)
    _, lines, _ = diff(dataset, copy)
    line = {name: section(lines, f"pixels in {name}") for name in ("normal", "flow", "object")}
    assert line == {
        "normal": ["view_0000f.exr: G differs in 1 pixel, at most by 0.5 at (5, 2)"],
        "flow": [
            "view_0000f.exr: X differs in 2 pixels, at most by 0.5 at (5, 2), X is 0 → nan at "
            "(1, 0), 1 pixel like that"
        ],
        "object": ["view_0000f.exr: numbers differ in 2 pixels, first 3 → 4 at (0, 3)"],
    }


def test_trouble_has_a_status_of_its_own(pair, diff, tmp_path):
    dataset, copy = pair
    status, lines, errors = diff(dataset, tmp_path / "nowhere")
    assert (status, lines) == (2, []) and errors.splitlines()[-1].startswith("error: ")
    status, _, errors = diff(dataset.parent, dataset)
    assert status == 2 and f"such as {dataset.name} in it" in errors
    (tmp_path / "x.tar").write_text("")
    assert "unpack a package first" in diff(dataset, tmp_path / "x.tar")[2]
    (copy / "lightfield.json").write_text("{")
    assert diff(dataset, copy)[0] == 2
    assert diff(dataset, "--wrong")[0] == 2


def edited(dataset, change):
    """Change the content of a dataset's lightfield.json."""
    path = dataset / "lightfield.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_another_machine_explains_last_digits(pair, diff):
    dataset, copy = pair
    edited(copy, lambda content: content.update(machine="GenuineIntel AVX2, glibc 2.41"))
    rewritten(copy / VIEW, darker(rows=1))
    (copy / "sha256sums.txt").unlink()
    status, lines, _ = diff(dataset, copy)
    assert status == 1
    assert re.match(r"equal settings; other machine: .* → GenuineIntel AVX2, glibc 2.41", lines[0])
    assert lines[0].endswith("last digits may differ, see docs/explanation/equal-bytes.md")
    assert (ROOT / "docs/explanation/equal-bytes.md").is_file()


def test_another_split_is_the_only_reason(pair, diff):
    dataset, copy = pair
    edited(copy, lambda content: content["frames"][2].update(split="test"))
    status, lines, _ = diff(dataset, copy)
    assert status == 1
    assert lines[0] == "the files differ because split differs"
    assert section(lines, "settings") == ["split: 1 view, such as view_0002f: None → test"]


VARIANTS = {
    "samples": ("samples: 4", "samples: 8"),
    "moved": ("center: [0, 0, 1.2]", "center: [0, 0.25, 1.2]"),
    "detail": ("{builder: room}", "{builder: room, parameters: {detail: 0.5}}"),
    "exposed": ("format: png", "format: png\n    exposure: 1"),
    "sequence": ("size: 0.5", "size: 0.5\n    frames: {first: 1, last: 2}"),
}


@pytest.fixture(scope="module")
def variants(tmp_path_factory):
    """The folder of the datasets of some scenes, each with one change."""
    small = tiny.SCENE.replace("[3, 2]", "[2, 2]")
    scenes = {name: small.replace(*change) for name, change in VARIANTS.items()}
    for name, place in (("place", 1), ("other_place", 2)):
        builder = f"{{builder: still_life, parameters: {{place: {place}}}}}"
        scenes[name] = small.replace("{builder: room}", builder)
    scenes["original"] = small
    folder = checkouts.checkout(tmp_path_factory.mktemp("variants"), **scenes)
    choice = ("--config", f"scenes=[{', '.join(scenes)}]", "rigs=all", "preset=full")
    rigs = [f"results/{name}/LFPlane" for name in scenes if name != "sequence"]
    rigs += [f"results/sequence/LFPlane/f0000{frame}" for frame in (1, 2)]
    exports = [f"{rig}/perspective/transforms.json" for rig in rigs]
    run = checkouts.snakemake(folder, "--cores", "2", *choice, "--", *exports)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder / "results"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("original", "name", "key", "change"),
    [
        ("original", "samples", "render.samples", "4 → 8"),
        ("original", "moved", "rig.center", "[0.0, 0.0, 1.2] → [0.0, 0.25, 1.2]"),
        ("place", "other_place", "scene.parameters.place", "1 → 2"),
    ],
)
def test_the_first_line_names_the_setting_that_differs(original, name, key, change, variants, diff):
    status, lines, _ = diff(variants / original / "LFPlane", variants / name / "LFPlane")
    assert status == 1
    assert lines[0] == f"the views differ because {key} differs"
    assert f"{key}: {change}" in section(lines, "settings")
    assert len(section(lines, "pixels in exr")) == 4
    assert len(section(lines, "pixels in perspective")) == 4
    titles = [line.split()[0] for line in lines if line and not line.startswith((" ", "A:", "B:"))]
    assert [*dict.fromkeys(titles[1:])] == [t for t in FIRST if t in titles]


@pytest.mark.slow
def test_a_setting_without_effect_leaves_equal_pixels(variants, diff):
    """The room has no detail that could be coarser."""
    status, lines, _ = diff(variants / "original/LFPlane", variants / "detail/LFPlane")
    assert status == 1
    assert lines[0].startswith("equal pixels; only scene.name, scene.parameters.detail, ")
    assert section(lines, "inputs")[0].startswith("fingerprint of the scene: ")


@pytest.mark.parametrize("angle", [1e-5, 30.0, 90.0, 179.9])
def test_a_turn_of_a_camera_is_told_in_degrees(angle):
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [8, 8]})
    rig = {"type": "lattice", "cameras": [1, 1, 1]}
    original = LightField.from_rig(rig, lens)
    turned = LightField.from_rig(rig | {"rotation": [0, angle, 0]}, lens)
    ((distance, degrees),) = changed_poses(original, turned).values()
    assert distance == 0
    assert degrees == pytest.approx(angle, rel=1e-6)


@pytest.mark.slow
def test_copies_without_receipts_still_say_which_cameras_moved(variants, diff, tmp_path):
    copies = [
        shutil.copytree(variants / name / "LFPlane", tmp_path / name)
        for name in ("original", "moved")
    ]
    _, lines, _ = diff(*copies)
    assert lines[0] == "the views differ because pose differs"
    _, line = section(lines, "settings")
    assert line.startswith("pose: 4 views moved, view_0000f by 0.25 m and 0°")


@pytest.mark.slow
def test_a_reprojections_setting_explains_its_images_alone(variants, diff):
    _, lines, _ = diff(variants / "original/LFPlane", variants / "exposed/LFPlane")
    assert lines[0] == (
        "the images in perspective differ because reprojections.perspective.exposure differs"
    )
    assert all("equal pixels" in line for line in section(lines, "pixels in exr"))


@pytest.mark.slow
def test_the_frames_of_a_sequence_are_compared_one_by_one(variants, diff, tmp_path):
    sequence = variants / "sequence/LFPlane"
    copy = shutil.copytree(sequence, tmp_path / "copy")
    assert diff(sequence, copy)[0] == 0
    rewritten(copy / "f00002/exr/view_0001f.exr", darker(rows=1))
    status, lines, _ = diff(sequence, copy)
    assert status == 1
    assert section(lines, "files with other bytes: 1 of ")[0].startswith(
        "f00002/exr/view_0001f.exr"
    )
    assert len(section(lines, "pixels in f00002/exr")) == 1
