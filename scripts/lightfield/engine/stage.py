"""A stage of a build as one typed object: its settings, and the files that it reads and writes.

A stage is a class. It has a field for each file that it `reads` or `writes`, and for each `option`
of a run, such as the number of threads. Its settings decide what it writes, and its options do not.

    class BuildScene(Stage[BuildSettings]):
        name = "build_scene"
        function = "lightfield.rendering.scenes.built_scene:build"
        by_hand = BuildSettings

        output: Path = writes(".blend to write")

The class determines the program with its flags (`lightfield.engine.flags`) and its page of the
reference. It also determines the settings file that the plan writes.
"""

import importlib
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr

from lightfield.engine import bundles, receipts
from lightfield.settings.base import ReaderSettings, Settings


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
    # The receipt has it. Raise it if equal settings give other results: everybody's jobs then run
    # again.
    version: ClassVar[int]
    # Whether what it makes depends on more than its receipt lists, such as times. It then works at
    # each start.
    reads_history: ClassVar[bool] = False
    # The exit status of its program after an error.
    error_status: ClassVar[int] = 1
    # The model whose fields are flags in place of a settings file.
    by_hand: ClassVar[type[Settings] | type[ByHand] | None] = None

    settings: StageSettings
    receipt: Path | None = Field(
        None,
        description="receipt to write last: the checksums of what was read and made",
        json_schema_extra={"role": "receipt", "metavar": "JSONL"},
    )
    # The content of the settings file, if there is one.
    _settings_file: dict[str, Any] | None = PrivateAttr(None)

    def run(self) -> Any:
        """Do the work, and write the receipt. Raises `UserError` if it cannot be done.

        Does nothing if the present receipt holds still.
        """
        if self.receipt is None:
            return self._do_work()
        header = {
            "stage": self.name,
            "version": getattr(self, "version", None),
            # Without a settings file, a rule takes the defaults.
            "settings": self._settings_file or {},
        }
        self._unpack_inputs()
        with receipts.opened(self.receipt, header, self.made()) as receipt:
            for path in self.inputs():
                receipt.add_input(path)
            if not self.reads_history and receipt.still_holds():
                print(f"{self.receipt}: still holds; there is nothing to do", flush=True)
                receipt.keep()
                result = None
            else:
                try:
                    result = self._do_work()
                finally:
                    # A damaged file may be the cause of another error.
                    receipt.check_inputs()
                receipt.seal()
        bundles.pack(self.receipt, self.made(), self.shared())
        return result

    def _unpack_inputs(self) -> None:
        """Unpack the bundles of the jobs that made the inputs, if jobs share no folder."""
        assert self.work_folder
        for path in self.inputs() if bundles.are_used() else ():
            if receipts.is_receipt(path):
                bundles.unpack(Path(path))
            elif found := receipts.find_output(receipts.name_of(path), self.work_folder):
                bundles.unpack(found[0])

    def note_settings(self, content: dict[str, Any]) -> None:
        """Note the content of the settings file, for the receipt."""
        self._settings_file = content

    @property
    def work_folder(self) -> Path | None:
        """The workflow's folder of intermediate files. None by hand, without a receipt."""
        return receipts.work_of(self.receipt) if self.receipt else None

    def _do_work(self) -> Any:
        module, _, name = self.function.partition(":")
        return getattr(importlib.import_module(module), name)(self)

    def inputs(self) -> Iterator[str | Path]:
        """Yield the files that the job reads. It may find more while it works."""
        yield from (path for path in self._paths("read") if not path.is_dir())
        if isinstance(self.settings, ReaderSettings):
            yield from self.settings.inputs

    def made(self) -> Iterator[Path]:
        """Yield the files that the job makes, and the folders in which it makes files."""
        yield from self._paths("written")

    def shared(self) -> Iterator[Path]:
        """Yield files beside the receipt's that other jobs need, also on other machines."""
        yield from ()

    def _paths(self, role: str) -> Iterator[Path]:
        """Yield the paths in the fields of a role."""
        for name, field in type(self).model_fields.items():
            extra = field.json_schema_extra
            if isinstance(extra, dict) and extra.get("role") == role:
                value = getattr(self, name)
                yield from value if isinstance(value, list) else [value] if value else []

    @classmethod
    def settings_model(cls, **_: Any) -> type[Settings]:
        """Return the model of the settings. It may depend on the stage's options."""
        return cls.model_fields["settings"].annotation  # type: ignore[return-value]


class PlainStage(Stage[NoSettings]):
    """A stage without settings: its results depend on its files alone."""

    settings: NoSettings = NoSettings()


def reads(text: str, default: Any = ..., **flag: Any) -> Any:
    """Return a field for a file or folder that a stage reads. ``text`` says what it is.

    ``flag`` says how it looks on a command line: see `lightfield.engine.flags`.
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
