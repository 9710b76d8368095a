"""Published datasets: shards with a view's pictures together, and descriptions of them."""

import ast
import io
import json
import os
import re
import shutil
import subprocess
import tarfile
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
import yaml
from markdown_it import MarkdownIt
from PIL import Image
from sphere import LENSES, write_views

from lightfield.configuration.publication import DOCUMENTS, Credits
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json
from lightfield.engine.bundles import VARIABLE
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.publishing import package
from lightfield.publishing.publish import publish

NAME = "smoke_LFPlane"
RIG = {"type": "plane", "cameras": [3, 2], "size": 0.4, "split": {"every": 3}}
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
PUBLISH = {
    "creators": [
        {"name": "Ada Lovelace", "orcid": "0000-0002-1825-0097"},
        {"name": "A Laboratory", "type": "organization"},
    ],
    "url": "https://example.org/dataset",
    "publisher": "Zenodo",
    "date": "2026-11-30",
    "limitations": "Few pixels.",
    "biases": "One room.",
    "personal_information": "None: no person is in it.",
    "use_cases": "Tests of programs.",
    "social_impact": "None is known.",
    "derived_from": ["https://example.org/textures"],
}
SCENE = {"description": "A sphere from within", "licence": "CC-BY-4.0", "publish": PUBLISH}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A finished dataset with a split, a pass, a reprojection with that pass, and an export."""
    dataset = tmp_path_factory.mktemp("publish") / "LFPlane" / "dataset"
    write_views(dataset, CAMERA, RIG)
    write_views(dataset / "perspective", LENSES["perspective"], RIG, suffix=".png")
    path = dataset / "lightfield.json"
    lightfield = LightField.read(path)
    content = {
        "scene": {"name": "smoke", "builder": "room", "parameters": {"seed": 7}},
        "render": {"samples": 4, "passes": ["normal"]},
    }
    lightfield.changed(**content).write(path)
    reprojected = dataset / "perspective/lightfield.json"
    LightField.read(reprojected).changed(**content, passes=["normal"]).write(reprojected)
    normals = {name: np.zeros((16, 16), np.float32) for name in "RGB"}
    for view in lightfield.views:
        for place in ("normal", "perspective/normal"):
            images.write_exr(dataset / place / f"{view.name}.exr", normals, {})
    write_json(dataset / "perspective/exports/colmap/export.json", {"format": "colmap"})
    write_json(dataset / "report/costs.json", {"not": "published"})
    write_json(dataset / "validation.json", {"valid": True})
    write_sums(dataset)
    return dataset


def write_sums(dataset):
    files = [path for path in dataset.rglob("*") if path.is_file() and "report" not in path.parts]
    lines = [f"{sha256(path)}  {path.relative_to(dataset)}\n" for path in sorted(files)]
    (dataset / "sha256sums.txt").write_text("".join(lines))


def published(folder, output, most=None, **changes):
    publish(folder, NAME, Credits.model_validate(SCENE | changes), output, most)
    return output


@pytest.fixture(scope="module")
def output(folder, tmp_path_factory):
    return published(folder, tmp_path_factory.mktemp("published") / NAME)


def members(tar):
    with tarfile.open(tar) as archive:
        return {entry.name: archive.extractfile(entry).read() for entry in archive}


def test_a_view_is_a_sample_with_its_passes_and_reprojections_together(folder, output):
    names = [name for tar in sorted(output.glob(f"{NAME}-*.tar")) for name in members(tar)]
    # WebDataset ends a sample where the text before the first dot changes.
    samples = [(key, [*group]) for key, group in groupby(names, lambda name: name.split(".")[0])]
    views = [view.name for view in LightField.read(folder / "lightfield.json").views]
    assert sorted(key for key, _ in samples) == sorted(views)
    pictures = ["normal.exr", "perspective+normal.exr", "perspective.png", "views.exr"]
    for key, group in samples:
        assert group == [f"{key}.json", *(f"{key}.{name}" for name in (*pictures, "thumbnail.jpg"))]


def test_a_sample_has_a_small_picture_of_its_view(tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, CAMERA | {"resolution": [400, 320]}, RIG)
    path = dataset / "lightfield.json"
    LightField.read(path).changed(scene={"name": "smoke"}).write(path)
    dark = dataset / "exr/view_0001f.exr"
    image = images.read_image(dark)
    quarter = {name: image.channels[name] / np.float16(4) for name in "RGB"}
    images.write_exr(dark, image.channels | quarter, image.attributes)
    write_sums(dataset)
    output = published(dataset, tmp_path / NAME)
    shards = [members(tar) for tar in output.glob(f"{NAME}-*.tar")]
    pictures = {
        name.partition(".")[0]: Image.open(io.BytesIO(content))
        for shard in shards
        for name, content in shard.items()
        if name.endswith(".thumbnail.jpg")
    }
    assert len(pictures) == 6
    for view, picture in pictures.items():
        assert picture.format == "JPEG"
        assert picture.size == (256, 205)
        x, y = (np.arange(5, side, 7) for side in (256, 205))
        shown = np.asarray(picture, float)[np.ix_(y, x)]
        light = images.read_image(dataset / f"exr/{view}.exr").colour
        light = light[np.ix_(y * 320 // 205, x * 400 // 256)].astype(float)
        for channel in range(3):
            roots = np.sqrt(light[..., channel]).ravel()
            assert np.corrcoef(shown[..., channel].ravel(), roots)[0, 1] > 0.97
    # All have one exposure: a darker view has a darker picture.
    brightness = {view: np.asarray(picture).mean() for view, picture in pictures.items()}
    assert brightness["view_0001f"] < 0.7 * brightness["view_0000f"]


def test_the_card_says_how_datasets_loads_the_shards(output):
    text = (output / "README.md").read_text()
    (code,) = re.findall(r"```python\nfrom datasets import load_dataset\n(.*?)```", text, re.S)
    patterns = ast.literal_eval(re.findall(r"^data_files = (.*)$", code, re.M)[0])
    assert patterns.keys() == {"train", "test"}
    matched = {path.name for pattern in patterns.values() for path in output.glob(pattern)}
    assert matched == {path.name for path in output.glob(f"{NAME}-*.tar")}
    columns = {name.partition(".")[2] for name in members(output / f"{NAME}-train-00000.tar")}
    assert {*re.findall(r'sample\["(.*?)"\]', code)} <= columns


def test_each_part_of_the_split_has_shards_of_its_own(folder, output):
    lightfield = LightField.read(folder / "lightfield.json")
    for split in ("train", "test"):
        keys = {name.split(".")[0] for name in members(output / f"{NAME}-{split}-00000.tar")}
        assert keys == {view.name for view in lightfield.views if view.split == split}


def test_views_for_validation_have_shards_of_their_own(tmp_path):
    rig = RIG | {"split": {"validation": ["view_0001f"], "test": ["view_0002f", "view_0003f"]}}
    write_views(tmp_path / "dataset", CAMERA, rig)
    path = tmp_path / "dataset/lightfield.json"
    LightField.read(path).changed(scene={"name": "smoke"}).write(path)
    write_sums(tmp_path / "dataset")
    output = published(tmp_path / "dataset", tmp_path / NAME)
    counts = {"train": 3, "validation": 1, "test": 2}
    for split, count in counts.items():
        keys = {name.split(".")[0] for name in members(output / f"{NAME}-{split}-00000.tar")}
        assert len(keys) == count
    assert len([*output.glob(f"{NAME}-*.tar")]) == 3


def test_a_sample_says_the_pose_and_the_bytes_of_each_picture(folder, output):
    content = members(output / f"{NAME}-train-00000.tar")
    view = next(name for name in content if name.endswith(".json")).removesuffix(".json")
    sample = json.loads(content[f"{view}.json"])
    (true,) = (v for v in LightField.read(folder / "lightfield.json").views if v.name == view)
    for name, picture in sample["pictures"].items():
        assert content[f"{view}.{name}"] == (folder / picture["path"]).read_bytes()
        assert picture["sha256"] == sha256(folder / picture["path"])
        assert picture["world_matrix"] == true.world_from_camera.tolist()
    assert sample["pictures"]["perspective.png"]["resolution"] == [64, 48]
    assert sample["pictures"]["views.exr"]["resolution"] == [16, 16]


def test_what_belongs_to_no_view_is_in_a_tar_of_its_own(folder, output):
    names = {name.removeprefix(f"{NAME}/") for name in members(output / "other_files.tar")}
    assert {"lightfield.json", "sha256sums.txt", "perspective/exports/colmap/export.json"} <= names
    assert not any(name.startswith(("exr", "normal", "report")) for name in names)
    in_shards = {
        picture["path"]
        for tar in output.glob(f"{NAME}-*.tar")
        for name, content in members(tar).items()
        if name.endswith(".json")
        for picture in json.loads(content)["pictures"].values()
    }
    listed = {line.split("  ")[1] for line in (folder / "sha256sums.txt").read_text().splitlines()}
    assert names | in_shards == listed | {"sha256sums.txt"}


def test_the_same_files_are_published_with_the_same_bytes(folder, output, tmp_path):
    for path in folder.rglob("*"):
        os.utime(path, (1, 1))
        path.chmod(0o777)
    again = published(folder, tmp_path / "again")
    written = {path.name: path.read_bytes() for path in output.iterdir()}
    assert written == {path.name: path.read_bytes() for path in again.iterdir()}


def test_files_behind_links_are_published(folder, output, tmp_path):
    linked = Path(shutil.copytree(folder, tmp_path / "linked"))
    for path in [path for path in linked.iterdir() if path.is_dir()]:
        shutil.move(path, tmp_path / "disk" / path.name)
        path.symlink_to(tmp_path / "disk" / path.name)
    again = published(linked, tmp_path / NAME)
    for path in output.iterdir():
        assert (again / path.name).read_bytes() == path.read_bytes(), path.name
    # The frames of a sequence are links, too.
    sequence = tmp_path / "sequence"
    sequence.mkdir()
    for frame in ("f00001", "f00002"):
        (sequence / frame).symlink_to(linked)
    of_frames = published(sequence, tmp_path / "of frames" / NAME)
    names = [name for tar in of_frames.glob(f"{NAME}-*.tar") for name in members(tar)]
    assert len({name.split(".")[0] for name in names}) == 12


def test_a_shard_has_at_most_the_size_that_is_asked_for(folder, tmp_path):
    output = published(folder, tmp_path / NAME)
    stale = output / f"{NAME}-train-00009.tar"
    stale.write_text("of an earlier publication")
    published(folder, output, most=30_000)
    shards = sorted(output.glob(f"{NAME}-train-*.tar"))
    assert len(shards) > 1
    assert stale not in shards
    for path in shards:
        keys = {name.split(".")[0] for name in members(path)}
        assert path.stat().st_size <= 30_000 or len(keys) == 1


def test_the_checksums_are_of_all_files(output):
    said = subprocess.run(
        ["sha256sum", "--check", "--strict", "sha256sums.txt"],
        cwd=output,
        capture_output=True,
        text=True,
        check=True,
    )
    checked = {line.removesuffix(": OK") for line in said.stdout.splitlines()}
    assert checked == {path.name for path in output.iterdir()} - {"sha256sums.txt"}


def test_croissant_lists_the_files_and_what_only_the_author_knows(output):
    content = read_json(output / "croissant.json")
    files = [entry for entry in content["distribution"] if entry["@type"] == "cr:FileObject"]
    listed = {entry["contentUrl"]: entry["sha256"] for entry in files}
    assert listed == {
        path.name: sha256(path) for path in output.iterdir() if path.suffix in (".tar", ".csv")
    }
    assert "http://mlcommons.org/croissant/1.1" in content["conformsTo"]
    assert content["rai:dataLimitations"] == "Few pixels."
    assert content["rai:personalSensitiveInformation"] == "None: no person is in it."
    assert content["rai:hasSyntheticData"] is True
    sources = [source["prov:label"] for source in content["prov:wasDerivedFrom"]]
    assert sources == ["the scene room", "https://example.org/textures"]
    assert content["license"].endswith("/CC-BY-4.0.html")
    assert content["datePublished"] == "2026-11-30"


@pytest.mark.parametrize(
    ("licence", "shown"),
    [
        ("CC-BY-4.0", {"license": "cc-by-4.0"}),
        (
            "Etalab-2.0",
            {
                "license": "other",
                "license_name": "etalab-2.0",
                "license_link": "https://spdx.org/licenses/Etalab-2.0.html",
            },
        ),
    ],
)
def test_the_card_has_the_front_matter_of_hugging_face(folder, tmp_path, licence, shown):
    output = published(folder, tmp_path / NAME, licence=licence)
    _, front_matter, text = (output / "README.md").read_text().split("---\n", 2)
    content = yaml.safe_load(front_matter)
    assert shown.items() <= content.items()
    assert content["size_categories"] == ["n<1K"]
    (config,) = content["configs"]
    for data_files in config["data_files"]:
        assert [*output.glob(data_files["path"])]
    assert "Few pixels." in text
    assert "Ada Lovelace" in text


TEXTS = ["description", *(f"publish.{key}" for key in PUBLISH if key != "derived_from")]


@pytest.mark.parametrize("missing", [TEXTS, ["publish.biases", "publish.publisher"], []])
def test_missing_texts_are_warned_of_and_left_out(folder, tmp_path, capsys, missing):
    texts = {key: text for key, text in PUBLISH.items() if f"publish.{key}" not in missing}
    scene = {key: SCENE[key] for key in ("description", "licence") if key not in missing}
    output = tmp_path / NAME
    publish(folder, NAME, Credits.model_validate(scene | {"publish": texts}), output, None)
    warnings = re.findall("warning: published without (.*), which", capsys.readouterr().err)
    assert [sorted(warning.split(", ")) for warning in warnings] == (
        [sorted(missing)] if missing else []
    )
    content = read_json(output / "croissant.json")
    keys = {
        "description": "description",
        "publish.creators": "creator",
        "publish.url": "url",
        "publish.publisher": "publisher",
        "publish.date": "datePublished",
        "publish.biases": "rai:dataBiases",
        "publish.limitations": "rai:dataLimitations",
    }
    assert {key for key in keys if keys[key] not in content} == keys.keys() & {*missing}
    assert content["license"].endswith("/CC-BY-4.0.html")
    readme = (output / "README.md").read_text()
    assert not re.search("(^|: )None$", readme, re.M)
    assert ("## Limits and use" in readme) == (missing != TEXTS)
    assert ("Biases: One room." in readme) == ("publish.biases" not in missing)


HOSTILE = '"><script>alert(1)</script>\n\n<img src=x onerror=alert(1)>\n\n```\n\n<b>'


def html_and_links(markdown):
    """Return the HTML that a text holds, and the addresses of its links."""
    tokens = MarkdownIt("commonmark").parse(markdown)
    tokens += [child for token in tokens for child in token.children or ()]
    html = [token.content for token in tokens if token.type in ("html_block", "html_inline")]
    return html, [token.attrs["href"] for token in tokens if token.type == "link_open"]


def test_texts_of_the_scene_yaml_put_markdown_but_no_html_into_the_cards(folder, tmp_path):
    creators = [{"name": f"Ada {HOSTILE}"}]
    texts = dict.fromkeys(("title", "publisher", "limitations", "biases", "use_cases"), HOSTILE)
    links = ["https://example.org/a", "https://example.org/b"]
    scene = {
        "description": f"[A room]({links[0]}), see <{links[1]}> {HOSTILE}",
        "licence": f"CC-BY-4.0 {HOSTILE}",
        "credit": HOSTILE,
        "publish": PUBLISH | texts | {"creators": creators, "licence": "CC-BY-4.0"},
    }
    output = published(folder, tmp_path / NAME, **scene)
    _, front_matter, text = (output / "README.md").read_text().split("---\n", 2)
    assert yaml.safe_load(front_matter)["pretty_name"] == HOSTILE
    html, found_links = html_and_links(text)
    assert html == []
    assert {*links} <= {*found_links}
    card = package.card(folder, NAME, Credits.model_validate(scene))
    (archive,) = package.pack(folder, card, tmp_path / "package.tar", None)
    html, found_links = html_and_links(members(archive)[f"{NAME}/README.md"].decode())
    assert html == []
    assert {*links} <= {*found_links}


def test_the_licence_of_the_data_may_differ_from_that_of_the_scene(folder, tmp_path):
    differing = {"licence": "CC0 (its models)", "publish": PUBLISH | {"licence": "CC-BY-4.0"}}
    output = published(folder, tmp_path / NAME, **differing)
    assert read_json(output / "croissant.json")["license"].endswith("/CC-BY-4.0.html")


def test_an_unfinished_dataset_is_not_published(folder, tmp_path):
    dataset = shutil.copytree(folder, tmp_path / "dataset")
    (dataset / "sha256sums.txt").unlink()
    with pytest.raises(UserError, match=r"sha256sums\.txt: is missing; only a valid dataset"):
        published(dataset, tmp_path / NAME)
    assert not (tmp_path / NAME).exists()


def test_a_view_of_an_unknown_part_is_named_and_not_left_out(folder, tmp_path):
    dataset = shutil.copytree(folder, tmp_path / "dataset")
    lightfield = LightField.read(dataset / "lightfield.json").to_json()
    lightfield["frames"][1]["split"] = "val"
    (dataset / "lightfield.json").write_text(json.dumps(lightfield))
    with pytest.raises(UserError, match="view_0001f: split: is 'val'; must be train, validation"):
        published(dataset, tmp_path / NAME)


def test_the_frames_of_a_sequence_are_samples_of_their_own(folder, tmp_path):
    for frame in ("f00001", "f00002"):
        shutil.copytree(folder, tmp_path / "sequence" / frame)
    output = published(tmp_path / "sequence", tmp_path / NAME)
    keys = {name.split(".")[0] for tar in output.glob(f"{NAME}-*.tar") for name in members(tar)}
    assert len(keys) == 12
    assert {key[:6] for key in keys} == {"f00001", "f00002"}


@pytest.mark.slow
def test_shards_and_parts_of_an_archive_come_back_from_a_storage(
    run_program, folder, tmp_path, monkeypatch
):
    store, home, job = tmp_path / "store", tmp_path / "home", tmp_path / "job"
    home.mkdir()
    job.mkdir()
    monkeypatch.setenv(VARIABLE, str(store))
    settings = tmp_path / "settings.json"
    write_json(settings, {"scene": SCENE, "gigabytes": 3e-5})
    output, archive = Path("results/smoke/published", NAME), Path(f"results/smoke/{NAME}.tar")
    for program, target in (("publish", output), ("package", archive)):
        arguments = ["--settings", settings, "--folder", folder, "--output", target]
        arguments += ["--receipt", f"work/receipts/smoke/LFPlane/{program}.jsonl"]
        run_program(f"{program}.py", *arguments, cwd=job)
    # Snakemake stores what the rules declare.
    shutil.copytree(job / "work/receipts", store / "work/receipts")
    (store / output).mkdir(parents=True)
    for file in (*(output / name for name in DOCUMENTS), archive, archive.with_suffix(".json")):
        shutil.copy(job / file, store / file)
    for name in (f"published/{NAME}", f"{NAME}.json"):
        path = f"results/smoke/{name}"
        run_program("take_dataset.py", "--store", store, path, cwd=home)
    taken = home / "results/smoke"
    made = {path.name: path.read_bytes() for path in (job / output).iterdir()}
    assert len([name for name in made if name.endswith(".tar")]) > 3
    assert {p.name: p.read_bytes() for p in (taken / "published" / NAME).iterdir()} == made
    parts = sorted((job / archive).parent.glob("*.tar"))
    assert len(parts) > 1
    assert [(taken / part.name).read_bytes() for part in parts] == [p.read_bytes() for p in parts]


def test_what_is_no_file_of_a_report_stays_in_the_storage(run_program, folder, tmp_path):
    dataset, home = tmp_path / "store/results/smoke/LFPlane", tmp_path / "home"
    shutil.copytree(folder, dataset)
    report = dataset / "report"
    (report / "subfolder").mkdir()
    (report / "overview.png").write_text("a picture")
    (report / "loop").symlink_to("loop")
    (report / "link").symlink_to("/etc/passwd")
    home.mkdir()
    path = "results/smoke/LFPlane"
    run_program("take_dataset.py", "--store", tmp_path / "store", path, cwd=home)
    taken = {each.name for each in (home / path / "report").iterdir()}
    assert taken == {"overview.png", "costs.json"}
    assert (home / path / "exr/view_0000f.exr").is_file()


@pytest.mark.slow
def test_the_program_writes_shards_and_descriptions(run_program, folder, tmp_path):
    settings = tmp_path / "settings.json"
    write_json(settings, {"scene": SCENE, "gigabytes": 1})
    output = tmp_path / NAME
    arguments = ["--settings", settings, "--folder", folder, "--output", output]
    said = run_program("publish.py", *arguments).stdout
    assert said.startswith(f"{Path(output)}: 4 files")
    assert (output / "croissant.json").is_file()
