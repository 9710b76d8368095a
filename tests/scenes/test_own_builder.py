"""A user's own builder: typed parameters, a fingerprint over its files, mistakes in one line."""

import json
import re
import shutil
import sys
from pathlib import Path
from textwrap import indent

import numpy as np
import pytest
from checkouts import ROOT, checkout, jobs_on, snakemake

from lightfield.configuration import keys, own_builder
from lightfield.configuration.scene_source import SceneSource
from lightfield.configuration.scene_yaml import read_scene
from lightfield.core import names
from lightfield.core.errors import UserError
from lightfield.imaging.images import write_png
from lightfield.stages.scene import BuildSettings

PAGE = (ROOT / "docs/how-to/write-a-scene-in-python.md").read_text()
# The scene and the YAML that the page shows.
YAML = re.search(r"```yaml\n(.*?)```", PAGE, re.S)[1]
SPIRAL = re.search(r"```python\n(.*?)```", PAGE, re.S)[1]
# The lines that animate it.
ANIMATION = re.search(r"## Animation\n.*?```python\n(.*?)```", PAGE, re.S)[1]
RENDERED = """
render: {samples: 1}
rigs:
  ring:
    type: ring
    count: 2
    size: 4
    camera: {lens: rectilinear, fov: 40, resolution: [16, 16]}
"""
IN_ROOM = RENDERED.replace("size: 4", "size: 1\n    center: [0, 0, 1]")
CUBE = """
import bpy
def build(parameters):
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.light_add(location=(0, 0, 4))
"""
TYPED = """
from enum import Enum
from typing import Annotated, Literal
import bpy
from pydantic import BaseModel, Field, field_validator

MOST = 9

class Wood(Enum):
    OAK = "oak"

class Tree(BaseModel):
    height: float = 1.0

    @field_validator("height")
    @classmethod
    def _grown(cls, height):
        assert height < 100, "too high"
        return height

class Parameters(BaseModel):
    count: Annotated[int, Field(ge=1, le=MOST)]
    size: tuple[float, float] = (1, 1)
    kind: Literal["round", "square"] = "round"
    wood: Wood = Wood.OAK
    tint: str = Field("red", pattern="^[a-z]+$")
    trees: list[Tree] = []

    @field_validator("size")
    @classmethod
    def _positive(cls, size):
        if min(size) <= 0:
            raise ValueError("must be positive")
        return size

bpy.ops.no.such_operator()

def build(parameters):
    pass
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The present folder, with a folder `scenes` for builders."""
    (tmp_path / "scenes").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(text, name="scenes/mine.py"):
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return name


def read(parameters="{}", builder="./scenes/mine.py", more=""):
    """Read a scene YAML with a builder. Return the block `scene`."""
    Path("mine.yaml").write_text(
        f"scene: {{builder: {builder}, parameters: {parameters}}}{RENDERED}{more}"
    )
    return read_scene(Path("mine.yaml")).scene


def refusal(*arguments, **keywords):
    with pytest.raises(UserError) as caught:
        read(*arguments, **keywords)
    message = str(caught.value)
    assert "\n" not in message
    return message


# ---- what a plan reads -------------------------------------------------------------------------


@pytest.mark.usefixtures("folder")
def test_parameters_are_typed_and_a_plan_runs_only_their_class(monkeypatch):
    written(TYPED)
    monkeypatch.setitem(sys.modules, "bpy", None)
    parameters = {"count": 3, "size": [1, 2.5], "kind": "square", "wood": "oak", "tint": "blue"}
    assert read(json.dumps(parameters)).parameters == parameters


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ("{}", "scene.parameters: is missing the key count"),
        ("{count: 0}", "scene.parameters.count: is 0; must be a whole number at least 1"),
        ("{count: 10}", "scene.parameters.count: is 10; must be a whole number at most 9"),
        ("{count: '3'}", 'scene.parameters.count: is "3"; must be a whole number'),
        ("{count: 3.0}", "scene.parameters.count: is 3.0; must be a whole number"),
        ("{count: 3, cuont: 4}", "scene.parameters.cuont: unknown key; did you mean count?"),
        ("{count: 3, place: 4}", "place: unknown key; scenes/mine.py has count, size, kind"),
        ("{count: 3, kind: oval}", 'kind: is "oval"; must be round or square'),
        ("{count: 3, size: [0, 1]}", "size: is [0, 1]; must be positive"),
        ("{count: 3, size: [1]}", "scene.parameters.size"),
        ("{count: 3, wood: pine}", 'wood: is "pine"; must be oak'),
        ("{count: 3, tint: Red}", 'tint: is "Red"; must be a text that matches ^[a-z]+$'),
        ("{count: 3, tint: null}", "tint: is null; must have a value, or be left out"),
        (
            "{count: 3, trees: [{}, {height: x}]}",
            'parameters.trees.[1].height: is "x"; must be a nu',
        ),
        ("{count: 3, trees: [{heihgt: 2}]}", "parameters.trees.[0].heihgt: is 2; must be left out"),
        ("{count: 3, trees: [{height: 101}]}", "trees.[0].height: is 101: too high"),
        ("{count: 2026-01-01}", "scene.parameters: must have only texts, finite numbers"),
        ("{count: .nan}", "scene.parameters: must have only texts, finite numbers"),
        ("3", "scene.parameters: is 3; must be a mapping of keys to values"),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    written(TYPED)
    message = refusal(parameters)
    assert re.match(r"mine\.yaml:1: scene\.parameters", message)
    assert said in message


@pytest.mark.usefixtures("folder")
def test_without_the_class_all_keys_are_allowed():
    written(CUBE)
    assert read("{a: 1, b: {c: [x]}}").parameters == {"a": 1, "b": {"c": ["x"]}}


CHECKED = """from dataclasses import dataclass
@dataclass
class Parameters:
    x: int = 0
    def __post_init__(self):
"""
# Of a name with several values, all statements count.
STEPS = f"""
try:
    from dataclasses import dataclass
except ImportError:
    raise
MOST = 1
MOST += 1
if MOST > 1:
    def double(x):
        return 2 * x
{CUBE}
@dataclass
class Parameters:
    x: int = double(MOST)
"""


@pytest.mark.usefixtures("folder")
def test_parameters_may_be_left_out_unless_one_is_needed():
    for text in (CUBE, TYPED.replace("MOST)]\n", "MOST)] = 1\n"), STEPS):
        scene = read_without_parameters(text)
        assert scene.parameters == {}
        BuildSettings(builder=scene.builder, parameters=scene.parameters)
    with pytest.raises(UserError, match="is missing the key count"):
        read_without_parameters(TYPED)


def read_without_parameters(text):
    written(text)
    # A file that was read is known by its text.
    note = f"# {hash(text)}"
    Path("mine.yaml").write_text(f"scene: {{builder: scenes/mine.py}} {note}{RENDERED}")
    return read_scene(Path("mine.yaml")).scene


WRONG = {
    "a mistake of syntax": ("def build(parameters):\n    return (\n", "scenes/mine.py:2: "),
    "no function": ("import bpy\n", "scenes/mine.py: has no function build(parameters)"),
    "nothing": ("", "scenes/mine.py: has no function build(parameters)"),
    "zeros": ("\0\0", "scenes/mine.py"),
    "a large file": ("#" * 2_000_000, "scenes/mine.py: is larger than 1000 kB"),
    "parameters from Blender": (
        f"from bpy import data\n{CUBE}\nclass Parameters:\n    x: data = 3\n",
        "scenes/mine.py:1: Parameters needs bpy",
    ),
    "parameters from a helper": (
        f"from .helper import Most\n{CUBE}\nclass Parameters:\n    x: Most = 3\n",
        "scenes/mine.py:1: Parameters needs .helper",
    ),
    "plain parameters": (
        f"{CUBE}\nclass Parameters:\n    x = 3\n",
        "scenes/mine.py: Parameters must be a dataclass or a pydantic model",
    ),
    "parameters that fail": (
        f"{CUBE}\nclass Parameters:\n    x = 1 / 0\n",
        "scenes/mine.py:8: ZeroDivisionError: division by zero",
    ),
    "parameters whose check fails": (
        f"{CHECKED}        self.x = 1 / self.x\n{CUBE}",
        "scenes/mine.py:6: ZeroDivisionError: division by zero",
    ),
    "parameters whose check exits": (
        f"{CHECKED}        raise SystemExit\n{CUBE}",
        "scenes/mine.py:6: SystemExit",
    ),
    "parameters of an unknown type": (
        f"from __future__ import annotations\n{CHECKED}        y: Unknown\n{CUBE}".replace(
            "x: int", "x: Unknown"
        ),
        "scenes/mine.py: PydanticUserError",
    ),
    "a file outside": (
        f"FILES = ['../secret.png']\n{CUBE}",
        "scenes/mine.py:1: FILES: is '../secret.png'; must be the path of a file in its folder",
    ),
    "a missing file": (
        f"FILES = ['oak.png']\n{CUBE}",
        "scenes/oak.png: cannot be read: No such file",
    ),
    "computed files": (f"FILES = sorted('ab')\n{CUBE}", "scenes/mine.py:1: FILES: must be one li"),
    "one text for files": (f"FILES = 'mine.py'\n{CUBE}", "scenes/mine.py:1: FILES: must be one li"),
    "files in two steps": (
        f"FILES = ['mine.py']\nFILES += ['oak.png']\n{CUBE}",
        "scenes/mine.py:2: FILES: must be one list",
    ),
}


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", WRONG)
def test_a_plan_refuses_a_wrong_builder_with_its_line(name):
    text, said = WRONG[name]
    written(text)
    assert refusal().startswith(said)


def test_a_builder_that_is_no_file_is_refused(folder):
    assert 'builder: is "./scenes/mine.py"; must be the path of a file that exists' in refusal()
    (folder / "scenes/mine.py").symlink_to("/dev/zero")
    assert refusal() == "scenes/mine.py: cannot be read: it is a device, not a file"


# ---- the fingerprint ---------------------------------------------------------------------------

IMPORTING = f"""
import json, plants.trees
from . import ground
from .walls import bricks
from scenes.library.lights import area_light
FILES = ["oak.png"]
def later():
    from plants import flowers
{CUBE}
"""
OWN_FILES = {
    "ground.py": "import numpy",
    "walls.py": "from roofs import tiles",
    "roofs.py": "from . import ground",
    "plants/__init__.py": "",
    "plants/trees.py": "from .leaves import leaf\nfrom .. import ground",
    "plants/leaves.py": "leaf = 1",
    "plants/flowers/__init__.py": "",
    "oak.png": "no code",
}
OTHERS = {"notes.txt": "", "unused.py": "", "plants/unused.py": "", "json.txt": ""}


def test_a_fingerprint_covers_what_the_builder_imports_from_its_folder_and_no_more(folder):
    written(IMPORTING)
    for name, text in (OWN_FILES | OTHERS).items():
        written(text, f"scenes/{name}")
    source = SceneSource(builder="./scenes/mine.py")
    found = {str(file) for file in own_builder.files(Path("scenes/mine.py"))}
    assert found == {"scenes/mine.py", *(f"scenes/{name}" for name in OWN_FILES)}
    before = keys.scene_fingerprint(source)
    for name in ("mine.py", *OWN_FILES):
        path = folder / "scenes" / name
        text = path.read_text()
        path.write_text(f"{text}\n# changed")
        assert keys.scene_fingerprint(source) != before, name
        path.write_text(text)
    for name in OTHERS:
        (folder / "scenes" / name).write_text("# changed")
    assert keys.scene_fingerprint(source) == before
    # Another folder with the same files makes the same scene.
    (folder / "scenes").rename(folder / "elsewhere")
    assert keys.scene_fingerprint(SceneSource(builder="elsewhere/mine.py")) == before


@pytest.mark.usefixtures("folder")
def test_only_a_builder_that_uses_the_library_depends_on_it(monkeypatch):
    written(CUBE)
    written(f"from scenes.library import lights\n{CUBE}", "scenes/other.py")
    sources = [SceneSource(builder=f"scenes/{name}.py") for name in ("mine", "other")]
    shutil.copytree(names.BUILDERS / "library", "builders/library")
    monkeypatch.setattr(keys, "BUILDERS", Path("builders").absolute())
    before = [*map(keys.scene_fingerprint, sources)]
    Path("builders/library/lights.py").write_text("# changed")
    after = [*map(keys.scene_fingerprint, sources)]
    assert after[0] == before[0] and after[1] != before[1]


# ---- the job -------------------------------------------------------------------------------------


def build(run_program, folder, text, parameters=None):
    written(text)
    settings = folder / "settings.json"
    settings.write_text(json.dumps({"builder": "scenes/mine.py", "parameters": parameters or {}}))
    arguments = ("--settings", settings, "--output", folder / "scene.blend")
    return run_program("build_scene.py", *arguments, check=False, cwd=folder)


FAILING = {
    "a wrong name": (f"{CUBE}    ball()\n", "scenes/mine.py:6: NameError: name 'ball' is not def"),
    "an import": (f"import no_such_package\n{CUBE}", "scenes/mine.py:1: ModuleNotFoundError: No"),
    "the library": (
        f"from scenes.library.scene import Scene\n{CUBE}    Scene(0, 1.0).add('a', 3)\n",
        "scenes/mine.py:7: AttributeError",
    ),
    "several lines": (
        f"{CUBE}    raise ValueError('a\\nb')\n",
        "scenes/mine.py:6: ValueError: a b",
    ),
    "an exit": (f"{CUBE}    raise SystemExit\n", "scenes/mine.py:6: SystemExit"),
    "a helper": (f"from helper import fail\n{CUBE}    fail()\n", "scenes/helper.py:2: KeyError: 7"),
    "a helper with a dot": (
        f"from .helper import fail\n{CUBE}    fail()\n",
        "scenes/helper.py:2: KeyError: 7",
    ),
    "an unlisted picture": (
        f"{CUBE}    bpy.data.images.load('scenes/oak.png')\n",
        "scenes/mine.py: shows",
    ),
    "arguments": ("def build():\n    pass\n", "scenes/mine.py: TypeError: build() takes 0"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAILING)
def test_an_error_of_the_users_code_is_one_line_with_its_place(folder, run_program, name):
    text, said = FAILING[name]
    written("def fail():\n    return {}[7]\n", "scenes/helper.py")
    write_png(Path("scenes/oak.png"), np.zeros((4, 4, 3), np.uint8))
    result = build(run_program, folder, text)
    assert result.returncode == 1
    errors = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1 and errors[0].startswith(f"error: {said}"), result.stderr
    assert "Traceback" not in result.stderr
    assert {path.name for path in folder.iterdir()} == {"scenes", "settings.json"}
    assert {path.name for path in (folder / "scenes").iterdir()} == {
        *("mine.py", "helper.py", "oak.png")
    }


def test_a_listed_picture_is_packed_and_helpers_start_anew_for_each_scene(folder, run_program):
    """Members of a family are built one after the other in one process."""
    program = written(
        """
import sys
from pathlib import Path
import bpy
from lightfield.rendering.scenes import blend_file, own_scene
for _ in range(2):
    blend_file.new_scene()
    own_scene.fill(Path("scenes/mine.py"), {"seed": 4})
    (image,) = bpy.data.images
    assert image.packed_file
    print(sorted(obj.name for obj in bpy.data.objects))
print([name for name in sys.modules if name.split(".")[0] in ("helper", "own_builder")])
print([path for path in sys.path if "scenes" in path])
""",
        "program.py",
    )
    written("calls = []\n", "scenes/helper.py")
    write_png(Path("scenes/oak.png"), np.zeros((4, 4, 3), np.uint8))
    written(
        f"""
from pathlib import Path
import helper
FILES = ["oak.png"]
{CUBE}
    helper.calls.append(1)
    bpy.data.images.load(str(Path(__file__).with_name("oak.png").absolute())).use_fake_user = True
    bpy.context.object.name = f"called {{len(helper.calls)}} with {{parameters['seed']}}"
"""
    )
    result = run_program(folder / program, cwd=folder)
    # Blender 5.0 also prints what it packs.
    lines = [line for line in result.stdout.splitlines() if not line.startswith("Info:")]
    *scenes, modules, paths = lines[-4:]
    assert scenes == ["['Cube', 'called 1 with 4']"] * 2
    assert (modules, paths) == ("[]", "[]")


def test_the_animation_of_the_page_moves_and_scales_its_object(folder, run_program):
    text = SPIRAL + indent(ANIMATION, "    ")
    result = build(run_program, folder, text, {"seed": 0, "balls": 1})
    assert result.returncode == 0, result.stderr
    program = written(
        """
import bpy
bpy.ops.wm.open_mainfile(filepath="scene.blend")
for frame in (1, 9, 17):
    bpy.context.scene.frame_set(frame)
    balloon = bpy.data.objects["balloon"]
    height = round(balloon.matrix_world.translation.z, 5)
    print("frame", frame, height, round(balloon.scale.x, 5))
""",
        "program.py",
    )
    # Blender prints other lines.
    printed = run_program(folder / program, cwd=folder).stdout
    frames = re.findall(r"^frame (.*)", printed, re.M)
    assert frames == ["1 1.0 0.5", "9 1.4 0.75", "17 1.8 1.0"]


# ---- the workflow -----------------------------------------------------------------------------


@pytest.mark.slow
def test_the_scene_of_the_page_is_built_and_a_helper_builds_it_again(tmp_path):
    tiny = re.sub(r"\[512, 512\]", "[32, 32]", YAML).replace("count: 24", "count: 2")
    tiny = tiny.replace("samples: 64", "samples: 1").replace("denoise: true", "denoise: false")
    folder = checkout(
        tmp_path / "plenoforge", spiral=tiny, other=f"scene: {{builder: room}}{IN_ROOM}"
    )
    text = SPIRAL.replace("import numpy", "import sizes\nimport numpy")
    assert text != SPIRAL
    (folder / "scenes").mkdir()
    (folder / "scenes/spiral.py").write_text(text)
    (folder / "scenes/sizes.py").write_text("")
    targets = [f"results/{name}/ring/validation.json" for name in ("spiral", "other")]
    choice = ("--config", "scenes=[spiral,other]", "rigs=all", "preset=full", "--", *targets)
    result = snakemake(folder, *choice)
    assert result.returncode == 0, result.stdout + result.stderr
    lightfield = json.loads((folder / "results/spiral/ring/lightfield.json").read_text())
    assert lightfield["scene"]["builder"] == "spiral.py"
    assert lightfield["scene"]["parameters"] == {"balls": 60}

    def planned():
        result = snakemake(folder, "--dry-run", "--logger", "jobs", *choice)
        assert result.returncode == 0, result.stderr
        return {
            (job["rule"], name)
            for job in jobs_on(result.stderr)
            for name in ("spiral", "other")
            if f"/{name}/" in job["output"][0]
        }

    assert planned() == set()
    (folder / "scenes/sizes.py").write_text("# changed")
    jobs = planned()
    assert {("build_scene", "spiral"), ("render", "spiral")} <= jobs
    assert not {name for _, name in jobs} - {"spiral"}
    (folder / "scenes/spiral.py").write_text(text.replace("number in", "number on"))
    result = snakemake(folder, *choice)
    assert result.returncode != 0
    assert re.search(r"^error: scenes/spiral\.py:\d+: invalid syntax", result.stderr, re.M)


@pytest.mark.slow
def test_members_get_their_seed_and_drawn_values(tmp_path):
    family = "family: {seeds: 0-1, values: {scene.parameters.balls: {integers: [1, 9]}}}\n"
    many = f"scene: {{builder: ./scenes/spiral.py}}{RENDERED}{family}"
    folder = checkout(tmp_path / "plenoforge", many=many)
    (folder / "scenes").mkdir()
    (folder / "scenes/spiral.py").write_text(SPIRAL)
    choice = ("--config", "scenes=many", "rigs=all", "preset=full")
    result = snakemake(folder, *choice)
    assert result.returncode == 0, result.stdout + result.stderr
    for member, seed in (("0000", 0), ("0001", 1)):
        lightfield = json.loads(
            (folder / f"results/many/{member}/ring/lightfield.json").read_text()
        )
        parameters = lightfield["scene"]["parameters"]
        assert parameters["seed"] == seed and 1 <= parameters["balls"] <= 9
    (folder / "scenes/spiral.py").write_text(SPIRAL + "\n")
    result = snakemake(folder, "--dry-run", "--logger", "jobs", *choice)
    assert "build_members" in {job["rule"] for job in jobs_on(result.stderr)}
    # A builder without a seed makes no family.
    (folder / "scenes/spiral.py").write_text(SPIRAL.replace("    seed: int = 0\n", ""))
    result = snakemake(folder, "--dry-run", *choice)
    assert "scene.parameters.seed: unknown key; scenes/spiral.py has balls" in result.stderr
