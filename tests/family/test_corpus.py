"""The corpus of a family: its split, its statistics, its page, its shards, and its sums."""

import csv
import json
import re
import shutil
import subprocess
import tarfile
from pathlib import Path

import accessibility
import families
import numpy as np
import pytest
from faults import CORPUS_KINDS, FAULTS, spoil
from PIL import Image

from lightfield import open_corpus, open_dataset
from lightfield.configuration.corpus import Shares
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.engine import receipts
from lightfield.family import corpus_looks
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.imaging.look import Look
from lightfield.stages.family import Corpus, CorpusSettings
from lightfield.validation.verification import faults
from lightfield.workflow import status

CAUSE = "models/broken.glb: is empty; must be a model"


def make(folder, cache=None, receipt=None, **settings):
    settings = CorpusSettings(family="chairs", **settings)
    cache = cache or folder.parent / "looks.json"
    job = Corpus(settings=settings, folder=folder, cache=cache, receipt=receipt)
    job.note_settings(settings.as_json())
    return job.run()


def files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(scope="module")
def members(tmp_path_factory):
    """A family of six valid members and a broken one."""
    family = tmp_path_factory.mktemp("members") / "chairs"
    for number in range(6):
        families.add_member(
            family, f"{number:04d}", shade=1 + number, wood=("oak", "ash")[number % 2]
        )
    families.add_failure(family, "broken", CAUSE)
    return family


@pytest.fixture
def family(members, tmp_path):
    return shutil.copytree(members, tmp_path / "chairs")


@pytest.fixture(scope="module")
def built(members, tmp_path_factory):
    """The same family with its corpus, and shards of few views each."""
    folder = shutil.copytree(members, tmp_path_factory.mktemp("corpus") / "chairs")
    make(folder, shards=True, shard_gigabytes=2e-5, splits={"validation": 0.3, "test": 0.3})
    return folder


# ---- members, split and statistics -----------------------------------------------------------


def test_a_corpus_lists_its_members_with_what_they_are_made_from(built):
    content = read_json(built / "corpus.json")
    names = [member["name"] for member in content["members"]]
    assert names == [*(f"{number:04d}" for number in range(6)), "broken"]
    first = content["members"][0]
    assert (first["seed"], first["values"]) == (0, {"shade": 1, "wood": "oak"})
    assert first["datasets"]["plane"]["views"] == 3
    assert content["members"][-1]["model"] == "models/broken.glb"


def test_a_corpus_opens_as_a_list_of_its_valid_members(built):
    corpus = open_corpus(built)
    assert [data.member["name"] for data in corpus] == [f"{number:04d}" for number in range(6)]
    assert corpus[3].member["values"] == {"shade": 4, "wood": "ash"}
    shards = sorted(built.glob("shards/*/*.tar"))
    assert len(shards) > 6
    in_shards = [data for part in shards for data in open_corpus(part)]
    for data in corpus:
        assert (data.member["split"], len(data.views)) == (part_of(built, data), 3)
        packed = [other for other in in_shards if other.member["name"] == data.member["name"]]
        assert {other.member["split"] for other in packed} == {data.member["split"]}
        packed_views = [view for other in packed for view in other.views]
        assert sorted(view.name for view in packed_views) == [view.name for view in data.views]
        for view in packed_views:
            np.testing.assert_array_equal(view.rgb, data.views[view.name].rgb)
            np.testing.assert_array_equal(view.rays(), data.views[view.name].rays())
    # All shards of a part together.
    of_part = open_corpus(built / "shards/train")
    assert [len(data.views) for data in of_part] == [3] * len(of_part)
    with pytest.raises(UserError, match="has 6 datasets; open_corpus"):
        open_dataset(built)


def test_the_shards_of_all_parts_open_as_the_corpus(built, tmp_path):
    """Also where only they were copied."""
    shards = shutil.copytree(built / "shards", tmp_path / "shards")
    data = {each.member["name"]: each for each in open_corpus(shards)}
    assert {name: each.member["split"] for name, each in data.items()} == {
        each.member["name"]: each.member["split"] for each in open_corpus(built)
    }
    assert [len(each.views) for each in data.values()] == [3] * 6


def test_missing_shards_of_a_corpus_are_named(built, tmp_path):
    family = shutil.copytree(built, tmp_path / "chairs")
    *_, last = sorted(family.glob("shards/train/*.tar"))
    shards = shutil.copytree(family / "shards", tmp_path / "shards")
    # The family's checksums list the last shard. Without them, there must be no gap.
    last.unlink()
    (shards / "train/chairs-train-00000.tar").unlink()
    for folder, missing in ((family / "shards", last.name), (shards, "chairs-train-00000.tar")):
        for place in (folder, folder / "train"):
            with pytest.raises(UserError, match=f"shards/train: misses {re.escape(missing)}"):
                open_corpus(place)
    assert open_corpus(family / "shards/train/chairs-train-00000.tar")


def part_of(family, data):
    members = read_json(family / "corpus.json")["members"]
    return next(each["split"] for each in members if each["name"] == data.member["name"])


def test_a_corpus_names_each_failure_with_its_cause(built):
    (failure,) = read_json(built / "corpus.json")["failures"]
    assert failure == {
        "name": "broken",
        "stage": "import_model",
        "cause": CAUSE,
        "log": "work/chairs/broken/log",
    }


def test_statistics_say_how_values_depths_and_brightness_are_distributed(built):
    numbers = read_json(built / "corpus.json")["statistics"]
    assert (numbers["members"], numbers["valid"], numbers["failed"]) == (7, 6, 1)
    assert numbers["views"] == 18
    datasets = [path for path in built.glob("*/plane/**/*") if path.is_file()]
    assert numbers["bytes"] == sum(path.stat().st_size for path in datasets)
    shade = numbers["values"]["shade"]
    assert (shade["least"], shade["median"], shade["largest"]) == (1, 3.5, 6)
    assert sum(shade["histogram"]) == 6
    assert numbers["values"]["wood"]["counts"] == {"ash": 3, "oak": 3}
    # The sphere of member n is 2 n metres away, and has the grey 0.2 n.
    assert numbers["pictures"]["farthest_metres"]["largest"] == 12
    assert numbers["pictures"]["nearest_metres"]["least"] == 2
    assert numbers["pictures"]["brightness"]["mean"] == pytest.approx(0.7, rel=1e-3)
    assert numbers["pictures"]["over_exposed"]["mean"] == pytest.approx(1 / 6, rel=1e-3)


def test_the_shares_of_a_split_hold_over_many_members():
    shares = Shares(validation=0.2, test=0.1)
    parts = [shares.part_of(f"{number:05d}") for number in range(10_000)]
    assert parts.count("test") == pytest.approx(1000, rel=0.1)
    assert parts.count("validation") == pytest.approx(2000, rel=0.1)
    assert parts.count("train") == pytest.approx(7000, rel=0.1)


def test_new_members_leave_the_split_of_others_alone(family):
    before = {each["name"]: each["split"] for each in make(family)["members"]}
    for number in range(6, 12):
        families.add_member(family, f"{number:04d}", shade=1, wood="oak")
    after = {each["name"]: each["split"] for each in make(family)["members"]}
    assert len(after) == 13
    assert before == {name: after[name] for name in before}


def test_the_split_is_the_same_on_every_machine():
    """These parts must never change: who has trained on a member must not test with it."""
    shares = Shares()
    names = ("0000", "0004", "0005", "0008", "chair", "Stühle")
    assert [shares.part_of(name) for name in names] == [
        "train",
        "test",
        "validation",
        "test",
        "train",
        "test",
    ]


def test_only_the_members_of_the_settings_count(family):
    content = make(family, members=["0001", "broken"])
    assert [member["name"] for member in content["members"]] == ["0001", "broken"]
    assert [path.stem for path in (family / "thumbnails").iterdir()] == ["0001"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"state": "odd"}, "state"),
        ({"datasets": {"plane": {"views": "3"}}}, "datasets.plane"),
        ({"name": "0002"}, "name"),
        ({"state": "failed"}, "failure"),
    ],
)
def test_a_damaged_record_of_a_member_is_named(family, change, said):
    path = family / "0001/member.json"
    path.write_text(json.dumps(read_json(path) | change))
    with pytest.raises(UserError) as caught:
        make(family)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert not (family / "sha256sums.txt").exists()


def test_a_dataset_that_changed_after_its_record_is_refused(family):
    with (family / "0003/plane/sha256sums.txt").open("a") as file:
        file.write("\n")
    with pytest.raises(UserError, match=r"0003/plane/sha256sums\.txt"):
        make(family)
    assert not (family / "sha256sums.txt").exists()


def test_shares_above_one_are_refused():
    with pytest.raises(ValueError, match="at most 1"):
        Shares(validation=0.6, test=0.6)


# ---- what members took -----------------------------------------------------------------------

KEYS = "name state split seed model views bytes built seconds cpu_seconds stage_cpu_seconds"
KEYS = [*KEYS.split(), "failed_stage", "error", "log"]


def test_each_member_has_a_line_of_json_with_all_keys(built):
    rows = [json.loads(line) for line in (built / "report/members.jsonl").read_text().splitlines()]
    assert [row["name"] for row in rows] == [*(f"{n:04d}" for n in range(6)), "broken"]
    assert all([*row] == KEYS for row in rows)
    assert (rows[2]["state"], rows[2]["seed"], rows[2]["views"]) == ("valid", 2, 3)
    assert rows[2]["error"] is None
    assert (rows[-1]["state"], rows[-1]["model"]) == ("failed", "models/broken.glb")
    assert (rows[-1]["failed_stage"], rows[-1]["error"]) == ("import_model", CAUSE)
    assert rows[-1]["log"] == "work/chairs/broken/log"


# ---- equal bytes -----------------------------------------------------------------------------


def test_equal_members_give_equal_bytes(members, tmp_path):
    results = []
    for name in ("first", "second"):
        folder = shutil.copytree(members, tmp_path / name / "chairs")
        make(folder, shards=True)
        # From the cache.
        make(folder, shards=True)
        results.append(files(folder))
    assert results[0] == results[1]


def test_a_damaged_thumbnail_or_cache_is_made_again(family):
    make(family)
    before = files(family)
    (family / "thumbnails/0002.webp").write_bytes(b"damaged")
    make(family)
    assert files(family) == before
    (family.parent / "looks.json").write_text("damaged")
    make(family)
    assert files(family) == before


@pytest.mark.parametrize("with_receipt_before", [False, True])
def test_a_receipt_has_all_files_of_a_corpus_also_if_they_are_kept(
    family, monkeypatch, with_receipt_before
):
    monkeypatch.chdir(family.parent)
    path = Path("work/receipts/chairs/corpus.jsonl")
    make(Path("chairs"), Path("looks.json"), path if with_receipt_before else None)
    make(Path("chairs"), Path("looks.json"), path, splits={"test": 0.5})
    made = {name for name in receipts.read(path).outputs if name.startswith("chairs/")}
    assert made == {f"chairs/{name}" for name in files(Path("chairs")) if not in_member(name)}


def in_member(name):
    return name.endswith("member.json") or "/plane/" in name


def test_thumbnails_have_the_look_of_the_scenes_pictures(family):
    make(family)
    plain = (family / "thumbnails/0002.webp").read_bytes()
    make(family, look={"name": "AgX"})
    shown = np.asarray(Image.open(family / "thumbnails/0002.webp").convert("RGB"), float)
    assert (family / "thumbnails/0002.webp").read_bytes() != plain
    views = corpus_looks.chosen_views(
        family / "0002/plane", LightField.read(family / "0002/plane/lightfield.json")
    )
    light = images.read_image(views[len(views) // 2]).colour
    expected = 255 * Look.of("AgX", 0).developed(np.nan_to_num(light))
    assert shown.reshape(-1, 3).mean(axis=0) == pytest.approx(
        expected.reshape(-1, 3).mean(axis=0), abs=4
    )


def test_a_cached_member_is_not_read_again(family):
    make(family)
    before = files(family)
    view = next((family / "0000/plane/exr").iterdir())
    content = view.read_bytes()
    view.unlink()
    make(family)
    view.write_bytes(content)
    assert files(family) == before


def test_a_member_that_is_built_anew_looks_anew(family):
    make(family)
    shutil.rmtree(family / "0000")
    families.add_member(family, "0000", shade=5, wood="oak")
    content = make(family)
    assert content["members"][0]["depth"] == [10, 10]


def test_members_without_depth_have_no_share_of_pixels_with_a_surface(family):
    for number in range(6):
        dataset = family / f"{number:04d}/plane"
        field = LightField.read(dataset / "lightfield.json")
        field.changed(depth=None).write(field.path)
        for path in dataset.glob("exr/*.exr"):
            channels = images.read_image(path, "RGB").channels
            images.write_exr(path, {name: channels[name] for name in "RGB"})
    content = make(family)
    assert content["members"][0]["depth"] is None
    assert content["members"][0]["covered"] is None
    assert content["statistics"]["pictures"]["covered"] == {"counts": {}}
    assert content["statistics"]["pictures"]["brightness"]["mean"] == pytest.approx(0.7, rel=1e-3)
    assert "with a surface" not in (family / "index.html").read_text()


# ---- shards ----------------------------------------------------------------------------------


def samples(tar):
    with tarfile.open(tar) as archive:
        return {entry.name: archive.extractfile(entry).read() for entry in archive}


def test_shards_have_every_view_in_the_part_of_its_member(built):
    split = {each["name"]: each["split"] for each in read_json(built / "corpus.json")["members"]}
    views = {}
    for tar in sorted((built / "shards").glob("*/*.tar")):
        # A tar is a multiple of 10,240 bytes, and one view needs about 5 kB.
        assert tar.stat().st_size <= 2 * 10_240
        content = samples(tar)
        for name, text in content.items():
            if not name.endswith(".json"):
                continue
            sample = json.loads(text)
            assert sample["split"] == tar.parent.name == split[sample["member"]]
            (picture,) = sample["pictures"].values()
            path = built / sample["member"] / sample["rig"] / picture["path"]
            assert content[name.replace(".json", ".views.exr")] == path.read_bytes()
            views.setdefault(sample["member"], set()).add(sample["view"])
    names = {view.name for view in LightField.read(built / "0000/plane/lightfield.json").views}
    assert views == {f"{number:04d}": names for number in range(6)}


def test_without_shards_there_are_none(built, tmp_path):
    folder = shutil.copytree(built, tmp_path / "chairs")
    make(folder)
    assert not [*folder.glob("shards/*/*")]
    assert faults(folder) == {}


def test_two_members_with_the_same_key_in_shards_are_named(family):
    for name in ("a.b", "a_b"):
        shutil.copytree(family / "0000", family / name)
        path = family / name / "member.json"
        path.write_text(json.dumps(read_json(path) | {"name": name}))
    with pytest.raises(UserError, match="rename the member"):
        make(family, shards=True, splits={"validation": 0, "test": 0})


# ---- shards that grow -------------------------------------------------------------------------

# A shard has the three views of one member, or fewer: each takes about 4 kB, and the tar 10.
SMALL = {"shards": True, "shard_gigabytes": 2.4e-5, "splits": {"validation": 0, "test": 0}}


def add(family, *numbers, shade=1.0):
    for number in numbers:
        families.add_member(family, f"{number:04d}", shade=shade)


def shard_bytes(family):
    return {path.name: path.read_bytes() for path in sorted(family.glob("shards/train/*.tar"))}


def keys(family):
    """Return the keys of all samples, in the order in which a loader reads them."""
    tars = sorted(family.glob("shards/train/*.tar"))
    return [name.split(".")[0] for tar in tars for name in samples(tar) if name.endswith(".json")]


def keys_of(*numbers):
    return [f"{n:04d}_plane_view_{view:04d}f" for n in numbers for view in range(3)]


def names_of(*numbers):
    return [f"chairs-train-{number:05}.tar" for number in numbers]


@pytest.fixture
def grown(tmp_path):
    """A family of members 2, 4 and 6 whose corpus has shards."""
    family = tmp_path / "results/chairs"
    add(family, 2, 4, 6)
    make(family, **SMALL)
    assert keys(family) == keys_of(2, 4, 6)
    assert len(shard_bytes(family)) > 2
    return family


@pytest.mark.parametrize("has_index", [True, False], ids=["", "of an older version"])
def test_new_members_leave_all_shards_but_the_last_as_they_are(grown, has_index):
    before = shard_bytes(grown)
    times = {path.name: path.stat().st_mtime_ns for path in grown.glob("shards/train/*.tar")}
    if not has_index:
        (grown / "shards/views.csv").unlink()
    add(grown, 3, 1)
    make(grown, **SMALL)
    after = shard_bytes(grown)
    assert [*after][: len(before)] == [*before]
    *full, _ = before
    assert {name: after[name] for name in full} == {name: before[name] for name in full}
    if has_index:
        # Nobody has written them again.
        assert {n: (grown / "shards/train" / n).stat().st_mtime_ns for n in full} == {
            name: times[name] for name in full
        }
    # New members follow in the order of their names, and the shards are as full as before.
    assert keys(grown) == keys_of(2, 4, 6, 1, 3)
    assert all(len(content) <= 3 * 10_240 for content in after.values())
    assert faults(grown) == {}
    assert len(open_corpus(grown / "shards/train")) == 5


def test_a_second_growth_goes_on_with_the_last_shard(grown):
    for number in (3, 1, 0):
        add(grown, number)
        *full, _ = shard_bytes(grown).items()
        make(grown, **SMALL)
        assert shard_bytes(grown).items() >= {*full}
    assert keys(grown) == keys_of(2, 4, 6, 3, 1, 0)
    # Nothing else fits into any shard but the last.
    together = shutil.copytree(grown, grown.with_name("other") / "chairs")
    shutil.rmtree(together / "shards")
    make(together, **SMALL)
    assert len(shard_bytes(together)) == len(shard_bytes(grown))
    assert keys(together) == keys_of(0, 1, 2, 3, 4, 6)


def test_a_member_that_goes_or_changes_renews_only_its_own_shards(grown):
    def shards_of(number):
        return {
            path.name
            for path in grown.glob("shards/train/*.tar")
            if any(name.startswith(f"{number:04d}_") for name in samples(path))
        }

    before, touched = shard_bytes(grown), shards_of(2)
    shutil.rmtree(grown / "0002")
    add(grown, 2, shade=3)
    make(grown, **SMALL)
    after = shard_bytes(grown)
    assert {name for name in before if before[name] != after.get(name)} == touched
    assert keys(grown) == keys_of(2, 4, 6)
    assert faults(grown) == {}

    # Its views go. A shard that has no view any more leaves its number to the next.
    shutil.rmtree(grown / "0002")
    make(grown, **SMALL)
    gone = after.keys() - shard_bytes(grown).keys()
    assert [*shard_bytes(grown)] == names_of(*range(len(after) - len(gone)))
    assert keys(grown) == keys_of(4, 6)
    kept = [content for name, content in after.items() if name not in touched]
    assert {*shard_bytes(grown).values()} >= {*kept}
    assert faults(grown) == {}


def test_the_index_says_which_shard_has_which_view(grown):
    add(grown, 1)
    make(grown, **SMALL)
    with (grown / "shards/views.csv").open() as file:
        rows = [*csv.DictReader(file)]
    assert [row["sample"] for row in rows] == keys(grown)
    for row in rows:
        content = json.loads(samples(grown / "shards" / row["shard"])[f"{row['sample']}.json"])
        told = {key: content[key] for key in ("member", "rig", "view", "split")}
        assert told == {key: row[key] for key in told}
    assert "shards/views.csv" in (grown / "sha256sums.txt").read_text()
    make(grown)
    assert not [path for path in grown.glob("shards/**/*") if path.is_file()]


@pytest.mark.parametrize("name", ["train/chairs-train-00001.tar", "views.csv"])
@pytest.mark.parametrize("damage", ["flipped", "deleted"])
def test_a_damaged_shard_or_index_gets_its_bytes_again(grown, monkeypatch, name, damage):
    monkeypatch.chdir(grown.parents[1])
    family, receipt = Path("results/chairs"), Path("work/receipts/chairs/corpus.jsonl")
    add(family, 3, 1)
    make(family, receipt=receipt, cache=Path("looks.json"), **SMALL)
    before = files(family / "shards")
    path = family / "shards" / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.unlink()
    if damage == "flipped":
        path.write_bytes(content)
    make(family, receipt=receipt, cache=Path("looks.json"), **SMALL)
    assert files(family / "shards") == before
    assert faults(family, Path("work")) == {}
    noted = receipts.read(receipt).outputs
    assert {f"results/chairs/shards/{each}" for each in before} <= noted.keys()


def test_a_shard_with_other_bytes_than_listed_is_written_again(grown):
    before = shard_bytes(grown)
    path = grown / "shards/train/chairs-train-00000.tar"
    path.write_bytes(before[path.name][::-1])
    make(grown, **SMALL)
    assert shard_bytes(grown) == before


def test_smaller_shards_move_views_to_the_end(grown):
    before = keys(grown)
    make(grown, **SMALL | {"shard_gigabytes": 1.7e-5})
    assert sorted(keys(grown)) == sorted(before)
    assert all(len(content) <= 2 * 10_240 for content in shard_bytes(grown).values())
    assert faults(grown) == {}


# ---- sums ------------------------------------------------------------------------------------


def test_the_sums_hold_and_cover_everything(built):
    result = subprocess.run(
        ["sha256sum", "--check", "--quiet", "sha256sums.txt"], cwd=built, check=False
    )
    assert result.returncode == 0
    listed = {line.split("  ")[1] for line in (built / "sha256sums.txt").read_text().splitlines()}
    beneath = {
        f"{path.parent.relative_to(built)}/{line.split('  ')[1]}"
        for path in built.glob("*/*/sha256sums.txt")
        for line in path.read_text().splitlines()
    }
    assert listed | beneath | {"sha256sums.txt", "report/members.jsonl"} == files(built).keys()
    assert faults(built) == {}


# Root may read a file without permissions. See `promises/test_damage.py` for these.
@pytest.mark.parametrize("fault", sorted(FAULTS.keys() - {"unreadable"}))
@pytest.mark.parametrize("kind", CORPUS_KINDS)
def test_every_fault_in_every_file_of_a_corpus_is_found(built, tmp_path, kind, fault):
    folder = shutil.copytree(built, tmp_path / "chairs")
    damaged = {str(folder / name) for name in spoil(folder, kind, fault)}
    assert faults(folder).keys() == damaged


@pytest.mark.parametrize("fault", ["emptied", "cut short", "deleted", "a folder"])
def test_the_status_of_a_family_leaves_out_members_with_damaged_records(built, tmp_path, fault):
    folder = shutil.copytree(built, tmp_path / "chairs")
    names = {member["name"] for member in read_json(folder / "corpus.json")["members"]}
    assert status.of_family("chairs", folder, names) == "chairs: 6 of 7 members built, 1 failed"
    spoil(folder, "record of a member", fault)
    assert status.of_family("chairs", folder, names) == "chairs: 5 of 7 members built, 1 failed"


def test_a_damaged_shard_and_a_foreign_one_are_found(built, tmp_path):
    folder = shutil.copytree(built, tmp_path / "chairs")
    first = sorted(folder.glob("shards/*/*.tar"))[0]
    first.write_bytes(first.read_bytes()[:-1])
    foreign = first.with_name("foreign.tar")
    foreign.write_bytes(b"foreign")
    assert faults(folder).keys() == {str(first), str(foreign)}


def test_a_dataset_that_the_sums_leave_out_is_found(built, tmp_path):
    folder = shutil.copytree(built, tmp_path / "chairs")
    sums = folder / "sha256sums.txt"
    lines = sums.read_text().splitlines(keepends=True)
    sums.write_text("".join(line for line in lines if "0002/plane" not in line))
    assert faults(folder).keys() == {str(folder / "0002/plane/sha256sums.txt")}
    sums.unlink()
    assert faults(folder).keys() == {str(sums)}


def test_what_a_corpus_no_longer_has_is_named_once(built, tmp_path):
    folder = shutil.copytree(built, tmp_path / "chairs")
    shutil.copytree(folder / "0001", folder / "0009")
    shutil.copytree(folder / "0001/plane", folder / "0002/ring")
    found = faults(folder)
    assert found.keys() == {str(folder / "0009"), str(folder / "0002/ring")}
    assert all("prune" in problem for problem in found.values())


def test_the_whole_files_of_a_failed_member_are_no_fault(built, tmp_path):
    folder = shutil.copytree(built, tmp_path / "chairs")
    shutil.copytree(folder / "0001/plane", folder / "broken/plane")
    (folder / "broken/plane/sha256sums.txt").unlink()
    assert faults(folder) == {}


def test_the_program_that_checks_every_byte_checks_a_corpus(built, run_program, tmp_path):
    folder = shutil.copytree(built, tmp_path / "chairs")
    assert "no fault" in run_program("verify.py", folder).stdout
    view = next((folder / "0004/plane/exr").iterdir())
    view.write_bytes(view.read_bytes()[:-1])
    result = run_program("verify.py", folder, check=False)
    assert (result.returncode, view.name in result.stdout) == (1, True)
    assert result.stderr.splitlines()[-1].startswith("error: 1 faults")


@pytest.mark.parametrize(
    ("name", "renewed"),
    [
        ("0001/plane/exr/view_0000f.exr", {"0001/plane/sha256sums.txt"}),
        ("0002/plane/sha256sums.txt", set()),
        ("0003/member.json", set()),
        ("thumbnails/0001.webp", set()),
        ("corpus.json", set()),
    ],
)
def test_mending_sets_aside_what_the_next_run_must_make_again(
    built, tmp_path, monkeypatch, run_program, name, renewed
):
    monkeypatch.chdir(tmp_path)
    folder = shutil.copytree(built, tmp_path / "results/chairs")
    before = files(folder)
    (folder / name).write_bytes(b"damaged")
    arguments = ("results/chairs", "--work", "work", "--mend")
    result = run_program("verify.py", *arguments, check=False, cwd=tmp_path)
    assert result.returncode == 1
    assert "the next run makes them again" in result.stderr
    removed = {name, "sha256sums.txt"} | renewed
    assert before.keys() - files(folder).keys() == removed
    assert files(tmp_path / "work/removed/results/chairs").keys() == removed


# ---- the page --------------------------------------------------------------------------------


def test_a_corpus_has_the_licence_and_the_credit_of_its_scene(members, tmp_path):
    folder = shutil.copytree(members, tmp_path / "chairs")
    facts = {"description": "Old chairs", "licence": "CC-BY-4.0", "credit": "A. Joiner"}
    assert make(folder, **facts).items() >= facts.items()
    page = (folder / "index.html").read_text()
    assert all(fact in page for fact in facts.values())
    assert not make(folder).keys() & facts.keys()


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_the_page_of_a_corpus_can_be_filtered(built, show, width):
    tab = show(built / "index.html", width)
    assert accessibility.faults(tab) == []
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    names = tab.locator("#cards li:visible h3")
    assert names.count() == 7
    loaded = "[...document.images].every((image) => image.complete && image.naturalWidth)"
    tab.locator("#cards li").last.scroll_into_view_if_needed()
    tab.wait_for_function(loaded)

    def shown():
        return names.all_inner_texts()

    tab.get_by_label("State").select_option("failed")
    assert shown() == ["broken"]
    tab.get_by_label("State").select_option("all")
    tab.get_by_role("combobox", name="wood").select_option("oak")
    assert shown() == ["0000", "0002", "0004"]
    tab.get_by_label("shade from").fill("2")
    tab.get_by_label("shade to").fill("4")
    assert shown() == ["0002"]
    assert tab.inner_text("#count") == "1 of 7 match"
    tab.get_by_label("Search").fill("nothing")
    assert shown() == []
    assert CAUSE in tab.inner_text("#failures")


def test_a_page_of_many_members_shows_a_part_and_more_on_demand(tmp_path, show):
    family = tmp_path / "chairs"
    for number in range(200):
        families.add_failure(family, f"{number:04d}", CAUSE)
    make(family)
    tab = show(family / "index.html")
    cards = tab.locator("#cards li")
    assert cards.count() < 200
    count = cards.count()
    tab.get_by_role("button", name="Show more").press("Enter")
    assert cards.count() == 200
    # The keyboard goes on with the first new member.
    assert tab.evaluate("document.activeElement.innerText").startswith(f"{count:04d}")
    assert not tab.get_by_role("button", name="Show more").is_visible()


def test_text_of_a_model_cannot_become_a_part_of_the_page(tmp_path, show):
    family = tmp_path / "chairs"
    families.add_failure(family, "a", "</script><img src=x onerror=alert(1)><b>")
    path = family / "a/member.json"
    path.write_text(json.dumps(read_json(path) | {"model": "</script><img src=x>"}))
    make(family)
    tab = show(family / "index.html")
    assert tab.locator("img").count() == 0
    assert "</script><img src=x>" in tab.inner_text("#cards")


def test_the_index_of_datasets_leads_to_a_corpus(built, run_program, show, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(built, results / "chairs")
    report = results / "chairs/0000/plane/report"
    report.mkdir()
    (report / "index.html").write_text("")
    output = results / "index.html"
    run_program("report_index.py", "--results", results, "--output", output)
    tab = show(output)
    # The members do not crowd out the datasets.
    assert tab.locator(".cards h2").all_inner_texts() == ["chairs"]
    assert accessibility.faults(tab) == []
    tab.get_by_role("link").click()
    assert tab.inner_text("h1") == "chairs"
