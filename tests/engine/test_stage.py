"""A stage is a typed class. Its program has a flag for each field, and names a wrong one."""

import ast
import importlib
import inspect
import json
import re
from pathlib import Path
from typing import Literal

import pytest
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.engine.flags import parsed, parser_of
from lightfield.engine.stage import Stage, cause, option, reads, writes
from lightfield.settings.base import Settings
from lightfield.stages.registry import STAGES

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


class Kiln(Settings):
    glow: float = Field(1.0, gt=0, description="How bright it is.")


class PotSettings(Settings):
    clay: str = Field(description="Name of the clay.")
    kiln: Kiln = Kiln()
    version: int | None = cause("If it changes, the pot is made again.")


class MakePot(Stage[PotSettings]):
    name = "make_pot"
    function = "json:dumps"
    by_hand = PotSettings

    molds: list[Path] = reads("molds", positional=True)
    output: Path = writes("pot to write", short=["-o"])
    colour: Literal["red", "grey"] = option("its colour", "grey")
    size: tuple[float, float] | None = option("its sides", None)
    feet: Literal[3, 4] = option("how many feet it has", 3)
    marks: list[str] | None = option("marks on it", None, may_be_empty=True)
    lid: Path | None = reads("its lid", None, may_be_empty=True)
    pot_name: str = option("its name", "", flag="--name")
    bands: list[tuple[str, int]] = option("bands around it", [], metavar=("COLOUR", "WIDTH"))


def make(*words):
    return parsed(MakePot, None, words)


def test_flags_become_the_fields_of_the_stage_and_the_keys_of_its_settings():
    pot = make("a", "b", "-o", "c", "--clay", "red", "--glow", "0.5", "--size", "1", "2.5")
    assert pot == MakePot(
        settings=PotSettings(clay="red", kiln=Kiln(glow=0.5)),
        molds=[Path("a"), Path("b")],
        output=Path("c"),
        size=(1.0, 2.5),
    )


def test_a_flag_may_be_empty_given_again_or_have_another_name():
    assert make("a", "-o", "c", "--clay", "red").marks is None
    assert make("a", "-o", "c", "--clay", "red", "--marks").marks == []
    assert make("a", "-o", "c", "--clay", "red", "--lid").lid is None
    assert make("a", "-o", "c", "--clay", "red", "--lid", "d").lid == Path("d")
    assert make("a", "-o", "c", "--clay", "red", "--name", "e").pot_name == "e"
    words = ["--marks", "x", "y", "--marks", "z", "--bands", "red", "2", "--bands", "grey", "3"]
    pot = make("a", "-o", "c", "--clay", "red", "--feet", "4", *words)
    assert (pot.feet, pot.marks, pot.bands) == (4, ["x", "y", "z"], [("red", 2), ("grey", 3)])
    assert "--bands COLOUR WIDTH" in parser_of(MakePot, None).format_help()


def test_a_settings_file_replaces_its_flags(tmp_path):
    file = tmp_path / "pot.json"
    file.write_text(json.dumps({"clay": "white", "version": 3}))
    pot = make("a", "--output", "c", "--settings", str(file))
    assert pot.settings == PotSettings(clay="white", version=3)
    with pytest.raises(UserError, match="--settings: excludes --glow; write it into the file"):
        make("a", "--output", "c", "--settings", str(file), "--glow", "2")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--glow", "2"], "--clay: is missing; or give --settings"),
        (["--clay", "red", "--glow", "0"], "--glow: is 0.0; must be a number above 0"),
        (["--clay", "red", "--size", "1", "nan"], "--size: is NaN; must be a finite number"),
        (
            ["--clay", "red", "--bands", "red", "wide"],
            '--bands: is "wide"; must be a whole number',
        ),
    ],
)
def test_a_wrong_value_is_named_by_its_flag(words, message):
    with pytest.raises(UserError, match=message):
        make("a", "--output", "c", *words)


def test_the_help_says_each_default_and_leaves_out_what_only_reruns():
    text = parser_of(MakePot, "Make a pot.").format_help()
    assert "its colour (default: grey)" in text
    assert "How bright it is (default: 1)" in text
    assert "--version" not in text


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_a_stage_names_a_function_that_takes_it(stage):
    module, _, name = stage.function.partition(":")
    (parameter,) = inspect.signature(
        getattr(importlib.import_module(module), name), eval_str=True
    ).parameters.values()
    assert parameter.annotation is stage


def test_each_version_in_a_key_is_a_stages_own():
    library = "\n".join(file.read_text() for file in SCRIPTS.glob("lightfield/**/*.py"))
    with_version = {stage.__name__ for stage in STAGES if hasattr(stage, "version")}
    assert with_version >= set(re.findall(r"\b([A-Z]\w+)\.version\b", library))


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_the_program_of_a_stage_is_a_docstring_and_one_call(stage):
    text = (SCRIPTS / f"{stage.name}.py").read_text()
    docstring, *statements = ast.parse(text).body
    assert isinstance(docstring, ast.Expr)
    assert text.count("\n") - docstring.end_lineno <= 20
    assert f"program({stage.__name__}, __doc__)" in ast.unparse(statements)
