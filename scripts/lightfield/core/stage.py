"""A stage of a build as one typed object: its settings, and the files that it reads and writes.

A stage is a class. It has a field for each file that it `reads` or `writes`, and for each `option`
of a run, such as the number of threads. Its settings decide what it writes, and its options do not.

    class BuildScene(Stage[BuildSettings]):
        name = "build_scene"
        function = "lightfield.rendering.built_scene:build"
        by_hand = BuildSettings

        output: Path = writes(".blend to write")

The class determines the program with its flags (`lightfield.core.flags`) and its page of the
reference. It also determines the settings file that a rule writes, and the stage of a family's
member.
"""

import importlib
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from lightfield.core.settings import Settings


class NoSettings(Settings):
    """The settings of a stage whose results depend on its files alone."""


StageSettings = TypeVar("StageSettings", bound=Settings)


class ByHand(BaseModel):
    """Flags that replace a settings file. For settings whose own keys make no good flags."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True, allow_inf_nan=False)

    @abstractmethod
    def settings(self, given: Mapping[str, Any]) -> Settings:
        """Return the settings that the flags mean.

        ``given`` are the stage's own fields that the command line gives, such as its files.
        """


class Stage(BaseModel, Generic[StageSettings]):
    """A job of a stage: its files, settings and options. `run` does the work."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True, allow_inf_nan=False)

    # The name of the program in scripts/.
    name: ClassVar[str]
    # The function that does the work, as "module:function". It takes the stage. `run` imports it,
    # so that --help does not wait for the import.
    function: ClassVar[str]
    # Part of the keys of what the stage writes. Raise it if equal settings give other results:
    # everybody's jobs then run again.
    version: ClassVar[int]
    # The model whose fields are flags in place of a settings file.
    by_hand: ClassVar[type[Settings] | type[ByHand] | None] = None

    settings: StageSettings

    def run(self) -> Any:
        """Do the work. Raises `UserError` if it cannot be done."""
        module, _, name = self.function.partition(":")
        return getattr(importlib.import_module(module), name)(self)

    @classmethod
    def settings_model(cls, **_: Any) -> type[Settings]:
        """Return the model of the settings. It may depend on the stage's options."""
        return cls.model_fields["settings"].annotation  # type: ignore[return-value]


class PlainStage(Stage[NoSettings]):
    """A stage without settings: its results depend on its files alone."""

    settings: NoSettings = NoSettings()


def reads(text: str, default: Any = ..., **flag: Any) -> Any:
    """Return a field for a file or folder that a stage reads. ``text`` says what it is.

    ``flag`` says how it looks on a command line: see `lightfield.core.flags`.
    """
    return _field("read", text, default, flag)


def writes(text: str, default: Any = ..., **flag: Any) -> Any:
    """Return a field for a file or folder that a stage writes, as `reads` does."""
    return _field("written", text, default, flag)


def option(text: str, default: Any = ..., **flag: Any) -> Any:
    """Return a field for an option that does not change what a stage writes, as `reads` does."""
    return _field("option", text, default, flag)


def cause(text: str) -> Any:
    """Return a field of settings that no program reads: if its value changes, the stage reruns."""
    return _field("cause", text, None, {})


def _field(role: str, text: str, default: Any, flag: dict[str, Any]) -> Any:
    return Field(default, description=text, json_schema_extra={"role": role, **flag})
