"""The config.yaml files of a run: the workflow's own, and the one in the user's folder.

Snakemake's command line gives some keys, or another workflow whose module this one is. The files
fill in the others.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lightfield.configuration.config_file import read_config, with_lines
from lightfield.core.disk_space import check_folder
from lightfield.core.errors import UserError
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

    def complete(self, config: dict[str, Any]) -> None:
        """Fill in the keys of Snakemake's ``config`` as the files have them.

        Snakemake reads no file for a module with a given configuration, and reads 12:30 as 750. So
        this replaces Snakemake's values, and adds the missing defaults.
        """
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
        """Return a message with the line of each key that it names in a config.yaml."""
        return with_lines(message, self._files, self._given)

    def mistake(self, problem: str) -> UserError:
        """Return the error for a mistake in config.yaml, with the line of the problem's key."""
        return UserError(self.located(f"{NAME}: {problem}"))
