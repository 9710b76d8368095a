"""Scenes that the user brings: downloaded, checked, and opened without running their scripts."""

import hashlib
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import version

import pytest
from checkouts import checkout, planned, snakemake

from lightfield.configuration import config_file, scene_yaml
from lightfield.core import download, names
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.planning.loading import load_datasets, scene_datasets
from lightfield.stages.scene import CheckBlend
from lightfield.workflow.presence import check_presence

CONTENT = bytes(range(256)) * 12345
SUM = hashlib.sha256(CONTENT).hexdigest()

BLEND_SCENE = """
scene: {{blend: {blend}{more}}}
render: {{samples: 1}}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {{lens: rectilinear, fov: 90, resolution: [16, 16]}}
"""


class Server:
    """A local web server with faults that a test chooses."""

    def __init__(self):
        self.content = CONTENT
        self.ranges = True
        self.shift = 0  # A part begins this many bytes after what was asked for.
        self.cut_after = []  # Each of the next transfers breaks off after this many bytes.
        self.asked = []  # The Range header of each request.
        owner = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                owner.answer(self)

            def log_message(self, *arguments):
                pass

        self.http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.http.server_port}/scene.blend"
        threading.Thread(target=self.http.serve_forever, daemon=True).start()

    def answer(self, request):
        tag = f'"{hashlib.md5(self.content).hexdigest()}"'
        wanted = request.headers.get("Range")
        self.asked.append(wanted)
        start = 0
        if wanted and self.ranges and request.headers.get("If-Range", tag) == tag:
            start = int(wanted.removeprefix("bytes=").rstrip("-"))
            if start >= len(self.content):
                request.send_response(416)
                request.send_header("Content-Range", f"bytes */{len(self.content)}")
                request.end_headers()
                return
            request.send_response(206)
            start += self.shift
            last = len(self.content) - 1
            request.send_header("Content-Range", f"bytes {start}-{last}/{len(self.content)}")
        else:
            request.send_response(200)
        request.send_header("ETag", tag)
        request.send_header("Content-Length", str(len(self.content) - start))
        request.end_headers()
        cut = self.cut_after.pop(0) if self.cut_after else len(self.content)
        request.wfile.write(self.content[start : start + cut])
        request.close_connection = True


@pytest.fixture
def server():
    server = Server()
    yield server
    server.http.shutdown()
    server.http.server_close()


def test_a_broken_transfer_continues_where_it_stopped(server, tmp_path):
    target = tmp_path / "blends" / "scene.blend"
    server.cut_after = [1_000_000, 500_000]
    download.fetch(server.url, target, SUM, "the test")
    assert target.read_bytes() == CONTENT
    assert server.asked == [None, "bytes=1000000-", "bytes=1500000-"]
    assert list(target.parent.iterdir()) == [target]


def test_a_later_run_continues_an_earlier_ones_download(server, tmp_path):
    target = tmp_path / "scene.blend"
    server.cut_after = [1_000_000, 0]
    with pytest.raises(UserError, match=r"1 MB are kept in .*scene\.blend\.part"):
        download.fetch(server.url, target, SUM, "the test")
    assert not target.exists()
    server.asked.clear()
    download.fetch(server.url, target, SUM, "the test")
    assert target.read_bytes() == CONTENT
    assert server.asked == ["bytes=1000000-"]


def test_a_complete_part_is_not_requested_again(server, tmp_path):
    target = tmp_path / "scene.blend"
    download.fetch(server.url, target, SUM, "the test")
    part = target.rename(tmp_path / "scene.blend.part")
    tag = f'"{hashlib.md5(CONTENT).hexdigest()}"'
    (tmp_path / "scene.blend.part.json").write_text(json.dumps({"version": tag}))
    server.asked.clear()
    download.fetch(server.url, target, SUM, "the test")
    assert server.asked == [f"bytes={len(CONTENT)}-"]
    assert target.read_bytes() == CONTENT
    assert not part.exists()


def test_a_part_longer_than_the_file_is_downloaded_again(server, tmp_path):
    target = tmp_path / "scene.blend"
    (tmp_path / "scene.blend.part").write_bytes(CONTENT + b"more")
    tag = f'"{hashlib.md5(CONTENT).hexdigest()}"'
    (tmp_path / "scene.blend.part.json").write_text(json.dumps({"version": tag}))
    download.fetch(server.url, target, None, "the test")
    assert server.asked == [f"bytes={len(CONTENT) + 4}-", None]
    assert target.read_bytes() == CONTENT


def test_a_server_without_ranges_sends_the_file_from_the_start(server, tmp_path):
    target = tmp_path / "scene.blend"
    server.ranges = False
    server.cut_after = [1_000_000]
    download.fetch(server.url, target, SUM, "the test")
    assert target.read_bytes() == CONTENT


def test_a_part_from_another_place_of_the_file_is_not_taken(server, tmp_path):
    """Such parts come from some caches. Without a SHA-256, nothing else would notice."""
    target = tmp_path / "scene.blend"
    server.cut_after = [1_000_000]
    server.shift = 4
    download.fetch(server.url, target, None, "the test")
    assert target.read_bytes() == CONTENT
    assert server.asked == [None, "bytes=1000000-", None]


def test_a_file_that_changed_meanwhile_is_downloaded_anew(server, tmp_path):
    target = tmp_path / "scene.blend"
    server.cut_after = [1_000_000, 0]
    with pytest.raises(UserError):
        download.fetch(server.url, target, None, "the test")
    server.content = CONTENT[::-1]
    server.asked.clear()
    download.fetch(server.url, target, None, "the test")
    assert target.read_bytes() == CONTENT[::-1]
    # The server compares the versions itself, and sends the new file at once.
    assert server.asked == ["bytes=1000000-"]


def test_versions_are_not_mixed_by_a_kill(server, tmp_path, monkeypatch):
    target = tmp_path / "scene.blend"
    server.cut_after = [1_000_000, 0]
    with pytest.raises(UserError):
        download.fetch(server.url, target, None, "the test")
    server.content = CONTENT[::-1]

    def killed(path, content):
        write_json(path, content)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(download, "write_json", killed)
        download.fetch(server.url, target, None, "the test")
    download.fetch(server.url, target, None, "the test")
    assert target.read_bytes() == CONTENT[::-1]


def test_a_wrong_file_is_refused_with_both_sums(server, tmp_path):
    target = tmp_path / "scene.blend"
    other = "0" * 64
    with pytest.raises(UserError, match=f"its sha256 is {SUM}, but the test says {other}"):
        download.fetch(server.url, target, other, "the test")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_server_is_named(tmp_path):
    with pytest.raises(UserError, match="refused"):
        download.fetch("http://127.0.0.1:9/scene.blend", tmp_path / "a.blend", SUM, "the test")


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """Return a function that writes a scene YAML with a .blend into the library's folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)

    def write(more="", blend="brought.blend"):
        (tmp_path / "own.yaml").write_text(BLEND_SCENE.format(blend=blend, more=more))
        return tmp_path / blend

    return write


def check(blend, scene="own"):
    output = blend.with_suffix(".json")
    output.unlink(missing_ok=True)
    CheckBlend(scene=scene, blend=blend, output=output).run()
    return json.loads(output.read_text())


def test_the_first_file_used_is_recorded_and_every_later_one_checked(scene):
    blend = scene()
    blend.write_bytes(CONTENT)
    assert scene_datasets("own")[0].source.sha256 is None
    assert check(blend)["sha256"] == SUM
    lock = blend.with_name("own.lock.json")
    assert json.loads(lock.read_text())["sha256"] == SUM
    assert scene_datasets("own")[0].source.sha256 == SUM
    check(blend)
    blend.write_bytes(CONTENT[1:])
    with pytest.raises(UserError) as caught:
        check(blend)
    for part in (str(blend), sha256(blend), SUM, f"to take the new file, delete {lock}"):
        assert part in str(caught.value)
    assert json.loads(lock.read_text())["sha256"] == SUM
    lock.unlink()
    assert check(blend)["sha256"] == sha256(blend)
    assert json.loads(lock.read_text())["sha256"] == sha256(blend)
    lock.write_text("{}")
    with pytest.raises(UserError, match=r"own\.lock\.json: sha256: is missing"):
        check(blend)


def test_a_built_scene_has_no_file_to_check(tmp_path):
    (tmp_path / "any.blend").write_bytes(CONTENT)
    with pytest.raises(UserError, match=r"--scene smoke: does not use a \.blend"):
        check(tmp_path / "any.blend", "smoke")


def test_a_downloads_checksum_is_checked_and_needs_no_lock(scene):
    blend = scene(more=f", url: 'https://example.org/own.blend', sha256: {SUM}")
    blend.write_bytes(CONTENT)
    check(blend)
    assert not blend.with_name("own.lock.json").exists()
    blend.write_bytes(b"another")
    with pytest.raises(UserError, match=rf"{sha256(blend)}, but .*own\.yaml says {SUM}"):
        check(blend)


def test_a_missing_file_gives_the_page_and_the_place(scene):
    scene(more=", page: 'https://example.org/scenes'", blend="blends/mine.blend")
    content = {"scenes": ["own"], "preset": "full", "presets": {"full": {}}}
    settings = config_file.load_config(content)
    with pytest.raises(UserError) as caught:
        check_presence(load_datasets(settings)[0])
    assert "there is no file blends/mine.blend" in str(caught.value)
    assert "get it from https://example.org/scenes and put it there" in str(caught.value)
    # A file that can be downloaded may be missing.
    scene(more=", url: 'https://example.org/mine.blend'", blend="blends/mine.blend")
    check_presence(load_datasets(settings)[0])


# The keys that an original scene does not share with its builder's scene.
OWN = {"scene", "description", "licence", "credit"}


@pytest.mark.parametrize("name", ["garden", "lone_monk", "barbershop"])
def test_an_original_scene_has_the_rigs_of_its_builders_scene(name):
    built, original = (scene_yaml.load_scene(scene) for scene in (name, f"{name}_original"))
    assert original.scene.page.startswith("https://")
    assert original.model_dump(exclude=OWN) == built.model_dump(exclude=OWN)


TRAPS = """
import bpy, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from scenes import room

folder = sys.argv[1]
bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
text = bpy.data.texts.new("autorun.py")
text.write(f"open({folder + '/script'!r}, 'w').close()")
text.use_module = True
driver = bpy.data.objects["cone"].driver_add("location", 2).driver
driver.type = "SCRIPTED"
driver.expression = f"open({folder + '/driver'!r}, 'w').close() or 0.5"
bpy.ops.wm.save_as_mainfile(filepath=folder + "/trap.blend")
for name in ("script", "driver"):
    Path(folder, name).unlink(missing_ok=True)
"""

OPENED = """
import sys
from pathlib import Path
folder = Path(sys.argv[1])
sys.path.insert(0, sys.argv[2])
import bpy
bpy.ops.wm.open_mainfile(filepath=str(folder / "trap.blend"), use_scripts=True)
bpy.context.scene.frame_set(3)
print("trusted:", *sorted(path.name for path in folder.iterdir()))
for name in ("script", "driver"):
    (folder / name).unlink(missing_ok=True)
from lightfield.rendering.scenes import blend_file
blend_file.open_scene(folder / "trap.blend")
bpy.context.scene.frame_set(2)
bpy.context.scene.frame_set(3)
print("ours:", *sorted(path.name for path in folder.iterdir()))
"""


def test_scripts_and_drivers_in_a_blend_do_not_run(run_program, tmp_path):
    for name, text in (("make.py", TRAPS), ("open.py", OPENED)):
        (tmp_path / name).write_text(text)
    folder = tmp_path / "scene"
    folder.mkdir()
    scripts = names.BUILDERS.parent
    run_program(tmp_path / "make.py", folder, scripts)
    lines = run_program(tmp_path / "open.py", folder, scripts).stdout.splitlines()
    # If Blender is told to trust the file, the traps do work.
    assert "trusted: driver script trap.blend" in lines
    assert "ours: trap.blend" in lines


def test_another_bpy_renders_a_brought_blend_again(tmp_path, room, monkeypatch):
    folder = checkout(tmp_path, brought=BLEND_SCENE.format(blend="mine.blend", more=""))
    (folder / "mine.blend").write_bytes(room.read_bytes())
    chosen = ("results/brought/LFPlane/lightfield.json", "--config", "scenes=[brought]")
    chosen += ("rigs=all", "preset=full")
    assert snakemake(folder, *chosen).returncode == 0
    again = snakemake(folder, *chosen)
    assert "Nothing to be done" in again.stdout + again.stderr

    other = tmp_path / "other/bpy-9.9.9.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: bpy\nVersion: 9.9.9\n")
    monkeypatch.setenv("PYTHONPATH", str(other.parent))
    assert planned(folder, *chosen) == {"check_blend": 1, "inventory": 1, "lightfield": 1}


def test_a_deleted_lock_file_is_written_again_and_finished_views_stay(tmp_path, room):
    text = BLEND_SCENE.format(blend="mine.blend", more="")
    # No camera is inside an object.
    text = text.replace("type: plane", "type: plane\n    size: 0.5\n    center: [0, 0, 1.3]")
    folder = checkout(tmp_path, brought=text)
    (folder / "mine.blend").write_bytes(room.read_bytes())
    chosen = ("--until", "render", "--config", "scenes=[brought]", "rigs=all", "preset=full")
    assert snakemake(folder, *chosen).returncode == 0
    view = folder / "results/brought/LFPlane/exr/view_0000f.exr"
    rendered = view.stat().st_mtime_ns
    lock = folder / "configs/scenes/brought.lock.json"
    lock.unlink()
    assert snakemake(folder, *chosen).returncode == 0
    assert json.loads(lock.read_text())["sha256"] == sha256(folder / "mine.blend")
    assert view.stat().st_mtime_ns == rendered
    assert planned(folder, *chosen) == {}


LINKED = """
import sys
import bpy
for name in ("library", "main"):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if name == "library":
        bpy.context.collection.objects.link(bpy.data.objects.new("thing", None))
    else:
        with bpy.data.libraries.load(sys.argv[1] + "/library.blend", link=True) as (_, wanted):
            wanted.objects = ["thing"]
        bpy.context.collection.objects.link(wanted.objects[0])
        bpy.ops.object.light_add(type="SUN")
    bpy.ops.wm.save_as_mainfile(filepath=f"{sys.argv[1]}/{name}.blend", compress=False)
"""


@pytest.mark.parametrize("newer", ["main", "library"])
def test_a_blend_newer_than_bpy_is_an_error_that_names_both_versions(newer, run_program, tmp_path):
    (tmp_path / "make.py").write_text(LINKED)
    run_program(tmp_path / "make.py", tmp_path)
    arguments = ("--blend", tmp_path / "main.blend", "--output", tmp_path / "inventory.json")
    run_program("inventory.py", *arguments)

    major, minor = map(int, version("bpy").split(".")[:2])
    path = tmp_path / f"{newer}.blend"
    content = path.read_bytes()
    mark = f"v{major:02}{minor:02}".encode()
    assert mark in content[:17]
    path.write_bytes(content.replace(mark, f"v{major:02}{minor + 1:02}".encode(), 1))
    result = run_program("inventory.py", *arguments, check=False)
    assert result.returncode == 1
    message = result.stderr.splitlines()[-1]
    assert message.startswith(
        f"error: {path}: was saved by Blender {major}.{minor + 1}, and Blender "
    )
    assert f"Blender {version('bpy')}" in message


@pytest.mark.slow
def test_a_downloaded_blend_needs_no_builder_and_a_built_one_no_download(server, tmp_path):
    fetched = BLEND_SCENE.format(blend="blends/fetched.blend", more=f", url: {server.url}")
    folder = checkout(
        tmp_path,
        brought=BLEND_SCENE.format(blend="mine.blend", more=""),
        fetched=fetched,
        again=fetched,
        built=BLEND_SCENE.replace("blend: {blend}{more}", "builder: room").format(),
    )
    (folder / "mine.blend").write_bytes(CONTENT)
    chosen = ("--config", "scenes=[brought,again,fetched,built]", "rigs=all", "preset=full")
    jobs = planned(folder, *chosen)
    assert jobs["render"] == 4
    assert jobs["check_blend"] == 3
    assert jobs["fetch_blend"] == jobs["build_scene"] == 1

    result = snakemake(folder, "blends/fetched.blend", *chosen)
    assert result.returncode == 0, result.stdout + result.stderr
    assert (folder / "blends" / "fetched.blend").read_bytes() == CONTENT
    # An existing file is never removed to be downloaded again.
    jobs = planned(folder, "--forceall", *chosen)
    assert jobs["check_blend"] == 3
    assert "fetch_blend" not in jobs
