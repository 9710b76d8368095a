"""Paths that files name lead nowhere else, and walks follow links without end."""

from pathlib import Path

import pytest

from lightfield.core import leftovers
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.paths import files_below, inside, lies_below, place_in
from lightfield.engine import bundles, receipts
from lightfield.formats.layout import read_sums
from lightfield.formats.lightfield import LightField
from lightfield.workflow.member_record import read_member

# Each leads to a file beside the folder "home", or to none.
HOSTILE = ["../x", "a/../../x", "..", "/tmp/x", "//tmp/x", "", ".", "a\0b", "./../x"]
DIGEST = "0" * 64


def write(path, content="x"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)
    return path


@pytest.mark.parametrize("name", [*HOSTILE, None, 3, ["x"]])
def test_a_path_that_leads_out_of_its_folder_is_refused(name, tmp_path):
    with pytest.raises(UserError, match=r"list\.json: files: is "):
        inside(tmp_path, name, "list.json: files")


@pytest.mark.parametrize("name", ["x", "./x", "a/x", "..x", "x..", "a\\..\\x", "…"])
def test_other_names_stay_in_the_folder(name, tmp_path):
    path = inside(tmp_path, name, "list.json")
    write(path)
    assert path.resolve().is_relative_to(tmp_path.resolve())


@pytest.mark.parametrize(
    "name",
    [
        *(*HOSTILE, None, 3, ["x"], "results", "results/", "results/.", "results/../x"),
        *("resultsx/y", "results//x", "./results/x", "/results/x", "../results/x", "results/a\0b"),
    ],
)
def test_a_path_that_is_not_written_as_one_below_a_folder_is_none(name):
    assert not lies_below(name, ["results", Path("work")])


@pytest.mark.parametrize("folder", ["results", "../results", "/data/results"])
def test_paths_below_a_folder_lie_below_it_wherever_it_is(folder):
    assert lies_below(f"{folder}/s/..x", ["work", Path(folder)])


def test_a_walk_follows_links_to_folders_and_files(tmp_path):
    dataset, disk = tmp_path / "dataset", tmp_path / "disk"
    write(disk / "exr/b.exr")
    write(disk / "exr/deep/c.exr")
    write(disk / "one.exr")
    write(dataset / "a.json")
    (dataset / "exr").symlink_to(disk / "exr")
    (dataset / "linked.exr").symlink_to(disk / "one.exr")
    (dataset / "gone.exr").symlink_to("nowhere")
    (dataset / "self.exr").symlink_to("self.exr")
    expected = ["a.json", "exr/b.exr", "exr/deep/c.exr", "linked.exr"]
    assert [path.relative_to(dataset).as_posix() for path in files_below(dataset)] == expected
    (tmp_path / "way").symlink_to(dataset)
    assert [*files_below(tmp_path / "way")] == [tmp_path / "way" / name for name in expected]
    assert [*files_below(tmp_path / "nowhere")] == []


@pytest.mark.parametrize("target", [".", "..", "/", "../exr"])
def test_a_link_to_a_folder_that_it_lies_in_is_named_and_the_walk_ends(target, tmp_path):
    write(tmp_path / "dataset/exr/a.exr")
    (tmp_path / "dataset/exr/loop").symlink_to(target)
    with pytest.raises(UserError, match="exr/loop: is a link to a folder that it lies in; remove"):
        list(files_below(tmp_path / "dataset"))
    files = files_below(tmp_path / "dataset", strict=False)
    assert [path.name for path in files] == ["a.exr"]


def test_two_folders_that_link_to_each_other_end_a_walk(tmp_path):
    write(tmp_path / "one/a")
    write(tmp_path / "two/b")
    (tmp_path / "one/two").symlink_to(tmp_path / "two")
    (tmp_path / "two/one").symlink_to(tmp_path / "one")
    with pytest.raises(UserError, match="one/two/one: is a link"):
        list(files_below(tmp_path / "one"))


def test_a_folder_that_nobody_may_read_hides_no_views(nobody):
    write(nobody / "dataset/exr/a.exr")
    (nobody / "dataset/exr").chmod(0)
    with pytest.raises(UserError, match="exr: cannot be read: "):
        list(files_below(nobody / "dataset"))
    assert list(files_below(nobody / "dataset", strict=False)) == []
    (nobody / "dataset/exr").chmod(0o700)


def test_unfinished_files_behind_links_are_removed(tmp_path):
    unfinished = write(tmp_path / "disk/.view_0000f.123.tmp.exr")
    (tmp_path / "dataset").mkdir()
    (tmp_path / "dataset/exr").symlink_to(tmp_path / "disk")
    (tmp_path / "disk/loop").symlink_to(".")
    assert leftovers.remove_unfinished(tmp_path / "dataset", age=-1) == [
        tmp_path / "dataset/exr" / unfinished.name
    ]
    assert not unfinished.exists()


def test_unfinished_files_of_the_excluded_folder_stay(tmp_path):
    others = [
        write(tmp_path / f"{name}/.a.png.123.tmp.png") for name in ("page", "exr", "exr/page")
    ]
    removed = leftovers.remove_unfinished(tmp_path, age=-1, excluded="page")
    assert sorted(removed) == sorted(others[1:])
    assert others[0].exists()


def test_a_place_is_found_through_the_links_to_its_folder(tmp_path):
    write(tmp_path / "disk/rig/exr/a.exr")
    (tmp_path / "big").mkdir()
    (tmp_path / "scene").symlink_to(tmp_path / "disk")
    (tmp_path / "disk/linked").symlink_to(tmp_path / "big")
    for folder in ("scene", "disk"):
        for other in ("scene", "disk"):
            found = place_in(tmp_path / folder, tmp_path / other / "rig/exr/a.exr")
            assert found == Path("rig/exr/a.exr")
            # The name in the folder counts, not that of the folder that it leads to.
            assert place_in(tmp_path / folder, tmp_path / other / "linked") == Path("linked")
    assert place_in(tmp_path / "big", tmp_path / "disk/rig") is None


# ---- the files that name paths ---------------------------------------------------------------


def sums_file(home, name):
    return read_sums(write(home / "sha256sums.txt", f"{DIGEST}  {name}\n"))


def bundle(home, name):
    receipt = home / "receipts/0-1.jsonl"
    header = '{"job": "0-1", "stage": "s", "version": 1, "settings": {}, "inputs": {}}'
    line = '{"file": %s, "sha256": "%s", "bytes": 1, "modified_ns": 1}' % (quoted(name), DIGEST)  # noqa: UP031
    write(receipt, f"{header}\n{line}\n")
    write(bundles.bundle_of(receipt))
    bundles.unpack(receipt)
    with receipts.opened(home / "receipts/reader.jsonl", {}, []) as job:
        job.add_input(receipt)


def member(home, name):
    entry = {"views": 1, "bytes": 1, "sha256sums": DIGEST}
    content = {"name": "m", "state": "valid", "datasets": {name: entry}}
    write_json(home / "m/member.json", content)
    return read_member(home / "m")


def flow(home, name):
    view = {"name": "a", "position": [0, 0, 0], "rotation": [0, 0, 0], "flow": name}
    return lightfield(home, {}, view)


def light_group(home, name):
    return lightfield(home, {"render": {"light_groups": {name: ["Lamp"]}}})


def lightfield(home, content, view=None):
    camera = {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": 180}
    frame = view or {"name": "a", "position": [0, 0, 0], "rotation": [0, 0, 0]}
    path = home / "lightfield.json"
    write_json(path, {"camera": camera, "resolution": [8, 8], "frames": [frame], **content})
    return LightField.read(path)


def view_name(home, name):
    return lightfield(home, {}, {"name": name, "position": [0, 0, 0], "rotation": [0, 0, 0]})


def quoted(name):
    return '"' + name.replace("\0", "\\u0000") + '"'


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("read", [sums_file, bundle, member, flow, light_group, view_name])
def test_no_reader_takes_a_path_that_leads_out_of_its_folder(read, name, tmp_path):
    with pytest.raises(UserError):
        read(tmp_path / "home", name)
