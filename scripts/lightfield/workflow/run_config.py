"""The config.yaml files of a run: the workflow's own, and the one in the user's folder.

Snakemake's command line gives some keys, by --config or in files by --configfile, or another
workflow whose module this one is. The config.yaml files fill in the others.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from lightfield.configuration.config_file import read_config, with_lines
from lightfield.core.disk_space import check_folder
from lightfield.core.errors import UserError
from lightfield.core.files import read_text
from lightfield.settings.yaml_files import as_written

NAME = "config.yaml"
# Snakemake's own folder in the folder of the run.
NOTES = Path(".snakemake")


@contextmanager
def ending_run() -> Iterator[None]:
    """End the run with one line at a `UserError`."""
    try:
        yield
    except UserError as error:
        sys.exit(f"error: {error}")


class RunConfig:
    """The config.yaml files of a run, and the keys that are given before them.

    ``folder`` is the folder of the workflow. ``given`` are the keys from the command line, or from
    the workflow whose module this is. Ends the run with one line for a file that cannot be read.
    """

    def __init__(self, folder: Path, given: Mapping[str, Any]) -> None:
        if {"{", "}"} & {*str(folder)}:
            sys.exit(
                f"error: {folder}: the path of Plenoforge's folder has a brace, which Snakemake "
                "takes for a wildcard: rename the folder, or move it"
            )
        self._given = set(given)
        self._on_command_line, files = _given_by(sys.argv[1:])
        self.has_own = Path(NAME).exists() and Path.cwd() != folder
        # The defaults, and before them the values of the user's own folder.
        self._files = [folder / NAME]
        if self.has_own:
            self._files.insert(0, Path(NAME))
        # Snakemake ends with a traceback if it cannot write its notes. It loads both files without
        # a limit of size, and does not name the line of a mistake.
        with ending_run():
            check_folder(NOTES)
            self._defaults = read_config(folder / NAME)
            self._own = read_config(Path(NAME)) if self.has_own else {}
            self._given_files = dict(self._read_given(files, given))

    @staticmethod
    def _read_given(
        files: Iterable[Path], given: Mapping[str, Any]
    ) -> Iterator[tuple[Path, dict[str, Any]]]:
        """Yield each file of given keys, and the keys whose values come from it.

        A later file, or --config, may have replaced a value. A workflow whose module this is may
        have files for itself.
        """
        for path in files:
            # With --directory, the path is relative to another folder. Snakemake reads YAML 1.1.
            is_yaml = path.suffix != ".json" and path.is_file()
            read = yaml.safe_load(read_text(path)) if is_yaml else None
            if isinstance(read, dict) and read.keys() <= given.keys():
                written = read_config(path)
                yield path, {key: written[key] for key in read if read[key] == given[key]}

    def complete(self, config: dict[str, Any]) -> None:
        """Fill in the keys of Snakemake's ``config`` as the files have them.

        Snakemake reads no file for a module with a given configuration, and reads 12:30 as 750. So
        this replaces Snakemake's values, and adds the missing defaults.
        """
        for written in self._given_files.values():
            as_written(config, written)
        own = {key: value for key, value in self._own.items() if key in config}
        for written in (self._defaults, own):
            others = {key: value for key, value in written.items() if key not in self._given}
            as_written(config, others)
        # The rigs in a config.yaml belong to the scenes in it. For other scenes, all rigs are
        # chosen.
        choosing_keys = self._given if "scenes" in self._given else set(self._own)
        if "scenes" in choosing_keys and "rigs" not in self._given | choosing_keys:
            config["rigs"] = "all"

    def located(self, message: str) -> str:
        """Return a message with the place of each key that it names in a config.yaml."""
        return with_lines(message, self._places_of)

    def _places_of(self, key: str) -> Sequence[Path | str]:
        """Return where a key at the top may stand, the place that counts first."""
        if key in self._on_command_line:
            return ["--config"]
        if key in self._given:
            files = [path for path, content in self._given_files.items() if key in content]
            # Else a profile gives it, or another workflow.
            return files[::-1] or ["configuration"]
        return self._files

    def mistake(self, problem: str) -> UserError:
        """Return the error for a mistake in config.yaml, with the line of the problem's key."""
        return UserError(self.located(f"{NAME}: {problem}"))


def _given_by(arguments: Sequence[str]) -> tuple[set[str], list[Path]]:
    """Return the keys that Snakemake's ``arguments`` give by --config, and the --configfiles."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--config", "-C", nargs="*", default=[])
    parser.add_argument("--configfile", "--configfiles", nargs="+", type=Path, default=[])
    given, _ = parser.parse_known_args(arguments)
    return {entry.partition("=")[0] for entry in given.config}, given.configfile
