"""The table's mistakes: each is refused, before anything is made."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from checkouts import checkout, snakemake
from mistakes import BOMB, EYE, MISTAKES, RIGHT, changed

from lightfield.configuration import config_file, scene_yaml
from lightfield.configuration.reprojections import Reprojection
from lightfield.core.errors import UserError
from lightfield.core.names import ROOT
from lightfield.exporters import EXPORTERS
from lightfield.exporters.base import ExportSettings
from lightfield.geometry.rigs import from_settings
from lightfield.planning.loading import load_datasets
from lightfield.settings.base import read_settings
from lightfield.stages.exports import MeshSettings
from lightfield.stages.measurement import CostSettings
from lightfield.stages.scene import ImportSettings

SNAKEMAKE = Path(sys.executable).with_name("snakemake")
SETTINGS = {
    "reproject.json": Reprojection,
    "mesh.json": MeshSettings,
    "colmap.json": ExportSettings[EXPORTERS["colmap"]],
    "instant_ngp.json": ExportSettings[EXPORTERS["instant_ngp"]],
    "costs.json": CostSettings,
    "import_model.json": ImportSettings,
}


class PlainDumper(yaml.SafeDumper):
    """Writes equal values each time, without aliases."""

    def ignore_aliases(self, data):
        return True


def read_with_mistake(mistake, file):
    """Write a file with its mistake, and read it as a program does."""
    value = mistake.value
    if not mistake.key and isinstance(value, (str, bytes)):
        file.write_bytes(value.encode() if isinstance(value, str) else value)
    if file.name == "scene.yaml":
        if mistake.key:
            file.write_text(yaml.dump(changed(mistake.key, value), Dumper=PlainDumper))
        scene_yaml.read_scene(file)
    elif file.name == "config.yaml":
        if not mistake.key:
            config_file.read_config(file)
        content = {"scenes": ["garden"], "preset": "full", "presets": {"full": {}}}
        load_datasets(config_file.load_config(content | value))
    elif file.name in SETTINGS:
        file.write_text(json.dumps(value))
        read_settings(SETTINGS[file.name], file)
    else:
        if mistake.key:
            frame = {"name": "b", **value} if isinstance(value, dict) else value
            frames = [{"name": "a", "world_matrix": EYE}, frame]
            file.write_text(json.dumps({"frames": frames}))
        from_settings({"type": "poses", "file": str(file)}).poses()


@pytest.mark.parametrize("mistake", MISTAKES, ids=str)
def test_a_mistake_is_refused_with_file_and_key(mistake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / mistake.file
    with pytest.raises(UserError) as caught:
        read_with_mistake(mistake, file)
    message = str(caught.value)
    lines = message.splitlines()
    assert all(line.isprintable() and len(line) <= 2001 for line in lines)
    assert len(lines) <= 11
    # A user must not see a regular expression.
    assert not re.search(r"\^[\[\\\w]|\]\*?\$", message), message
    # The line of a key of config.yaml is known where its files are.
    named = file.name if mistake.file == "config.yaml" else file
    places = [re.match(rf"{re.escape(str(named))}(:\d+){{0,2}}: ", line) for line in lines]
    assert all(places)
    assert message[places[0].end() :].startswith(mistake.said)
    assert mistake.allowed in message
    if mistake.file == "scene.yaml" and mistake.key:
        lines_of_keys = lines_of(file.read_text())
        for line, place in zip(lines, places, strict=True):
            problem = line[place.end() :]
            assert place[0] == f"{file}{line_of(problem, lines_of_keys)}: ", problem


def lines_of(text):
    """Return the lines of the keys and list items of a YAML file in block style, by the keys."""
    lines = {}
    # The keys above a line, with their columns. An item may be in the column of its key.
    parents = []
    for number, line in enumerate(text.splitlines(), 1):
        column = len(line) - len(line.lstrip())
        while line[column:].startswith("- "):
            items = [key for place, key in parents if place == column and key.startswith("[")]
            index = int(items[0][1:-1]) + 1 if items else 0
            parents = [(c, k) for c, k in parents if c < column or (c == column and k[0] != "[")]
            parents.append((column, f"[{index}]"))
            lines[".".join(key for _, key in parents)] = number
            column += 2
        if match := re.match(r"([\w.-]+):(?: |$)", line[column:]):
            parents = [(place, key) for place, key in parents if place < column]
            parents.append((column, match[1]))
            lines[".".join(key for _, key in parents)] = number
    return lines


def line_of(problem, lines_of_keys):
    """Return ``:line`` of the longest key with which a problem begins. Or nothing without one."""
    # The values that a family draws stand for keys of its members.
    values = "family.values."
    drawn = {k.removeprefix(values): line for k, line in lines_of_keys.items() if values in k}
    lines = lines_of_keys | drawn
    keys = [key for key in lines if re.match(rf"{re.escape(key)}(: |\.)", problem)]
    return f":{lines[max(keys, key=len)]}" if keys else ""


def test_all_mistakes_of_a_scene_yaml_are_told_at_once(tmp_path):
    content = changed("reprojection", {})
    content["scene"] |= {"sed": 7, "frame": "x"}
    content["render"] |= {"seed": None, "samples": 0}
    content["rigs"]["LFSphere"] |= {"size": "1m", "look_at": [0, 0]}
    content["rigs"]["LFCuboid"]["type"] = "box"
    del content["reprojections"]["perspective"]["camera"]["resolution"]
    file = tmp_path / "scene.yaml"
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(UserError) as caught:
        scene_yaml.read_scene(file)
    lines = str(caught.value).splitlines()
    assert all(line.startswith(f"{file}:") for line in lines)
    problems = [re.sub(r"^:(\d+:)? ", "", line.removeprefix(str(file))) for line in lines]
    starts = [
        "reprojection: unknown key; did you mean reprojections?",
        "scene.sed: unknown key",
        'scene.frame: is "x"; must be a whole number or file',
        "render.seed: is null; must have a value",
        "render.samples: is 0; must be",
        'rigs.LFSphere.size: is "1m"; must be a number or a list of 3',
        "rigs.LFSphere.look_at: is [0, 0]; must be a list of 3",
        'rigs.LFCuboid.type: is "box"; must be one of',
        "reprojections.perspective.camera: is missing the key resolution",
    ]
    assert len(problems) == len(starts)
    for start in starts:
        assert any(problem.startswith(start) for problem in problems), (start, problems)
    # More than ten are counted.
    content["sensor"] = {f"key_{number}": 1 for number in range(9)}
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(UserError) as caught:
        scene_yaml.read_scene(file)
    *lines, last = str(caught.value).splitlines()
    assert len(lines) == 10
    assert last == f"{file}: 8 more mistakes"


# Runs a command and prints its peak memory. In a process of its own, because Linux counts the
# memory of the starting process too, which would be pytest's.
MEASURED = """
import resource, subprocess, sys
status = subprocess.run(sys.argv[1:], stdout=sys.stderr).returncode
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(status)
"""


CHOICE = "scenes: hostile\nrigs: all\npreset: full\n"


@pytest.mark.parametrize(
    ("text", "config_text", "arguments"),
    [
        ("a0: &a0 [x]\n" + BOMB + "rigs: *a11\n", CHOICE, []),
        (yaml.safe_dump(RIGHT), CHOICE, ["work=a;id"]),
        (yaml.safe_dump(RIGHT), CHOICE + "views_per_shard: 12:30\n", []),
        ("", "a0: &a0 [x]\n" + BOMB, []),
    ],
)
@pytest.mark.slow
def test_a_hostile_plan_ends_with_one_line_and_little_memory(
    text, config_text, arguments, tmp_path
):
    """The user's own folder has the user's config.yaml."""
    (tmp_path / "configs/scenes").mkdir(parents=True)
    (tmp_path / "configs/scenes/hostile.yaml").write_text(text)
    (tmp_path / "config.yaml").write_text(config_text)
    command_line = ("-n", "--cores", "1", "--snakefile", ROOT / "Snakefile")
    command = [SNAKEMAKE, *command_line, *(["--config", *arguments] if arguments else [])]
    run = subprocess.run(
        [sys.executable, "-c", MEASURED, *map(str, command)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode != 0
    *lines, largest = (run.stderr + run.stdout).splitlines()
    header = ("host: ", "Using workflow specific profile ", "Config file ")
    assert [line for line in lines if not line.startswith(header)] == [lines[-1]]
    assert lines[-1].startswith("error: ")
    # The figure is in KiB, except on macOS.
    assert int(largest) * (1 if sys.platform == "darwin" else 1024) < 500e6
    assert not (tmp_path / "results").exists() and not (tmp_path / "work").exists()


CHECKOUTS_CONFIG = (ROOT / "config.yaml").read_text()
LAST_LINE = CHECKOUTS_CONFIG.count("\n") + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("scenes: [garden]\n\tpreset: full\n", "config.yaml:2:1: is indented with a tab"),
        (CHECKOUTS_CONFIG + "energie: 1\n", f"config.yaml:{LAST_LINE}: energie: unknown key"),
        (None, "config.yaml: cannot be read as YAML"),
    ],
)
def test_a_fault_in_the_checkouts_own_config_is_one_line(text, problem, tmp_path):
    folder = checkout(tmp_path)
    if text is None:
        (folder / "config.yaml").unlink()
    else:
        (folder / "config.yaml").write_text(text)
    run = snakemake(folder, "--dry-run")
    said = (run.stdout + run.stderr).splitlines()
    assert run.returncode != 0
    assert said[-1].startswith(f"error: {problem}")
    assert len(said) <= 2
