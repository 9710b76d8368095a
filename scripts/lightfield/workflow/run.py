"""A run of the workflow: its configuration and datasets, the machine, and the names of its files.

The Snakefile makes one `Run`, and the rules ask it. A rule's input function gets the wildcards of
a job from Snakemake, and asks the `Build` about the job's dataset.
"""

import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from lightfield.configuration.config_file import Configuration, load_config
from lightfield.configuration.dataset import Cluster, Dataset
from lightfield.configuration.dataset_paths import Paths
from lightfield.core import gpus
from lightfield.core.errors import UserError
from lightfield.core.memory import available
from lightfield.core.names import RENDERED
from lightfield.formats.passes import FLOW
from lightfield.workflow import presence
from lightfield.workflow.build import Build, Wildcards
from lightfield.workflow.jobs import Job
from lightfield.workflow.run_config import NOTES, RunConfig, ending_run

Answer = TypeVar("Answer")
Question = Callable[[Wildcards], Answer]
"""What a function of the build answers about a job, by the job's wildcards."""


class HasWildcards(Protocol):
    """The wildcards of a job, as Snakemake gives them to the functions of a rule."""

    def items(self) -> Iterable[tuple[str, str]]: ...


class Marks(NamedTuple):
    """The functions of Snakemake's language that say how it treats a file of a rule."""

    ancient: Callable[[Any], Any]
    local: Callable[[Any], Any]
    unpack: Callable[[Any], Any]
    update: Callable[[Any], Any]


def one_of(names: Iterable[str]) -> str:
    """Return the wildcard's constraint that matches these names, or nothing without any."""
    return "|".join(sorted(map(re.escape, names))) or "(?!)"


@dataclass(frozen=True)
class Run:
    """A run: its configuration and datasets, and the machine.

    ``folder`` is the folder of the workflow. ``cores`` are the cores of this machine, or of each
    job on a ``cluster``. Jobs on a cluster read the Snakefile again: ``is_main`` says whether this
    process is the one that the user has started.
    """

    config: RunConfig
    build: Build
    cluster: Cluster | None
    folder: Path
    cores: int
    is_main: bool
    marks: Marks

    @classmethod
    def load(
        cls,
        config: RunConfig,
        content: dict[str, Any],
        folder: Path,
        cores: Callable[[], int],
        is_main: bool,
        marks: Marks,
    ) -> "Run":
        """Load the datasets that a configuration's ``content`` chooses.

        Ends the run with one line for a mistake in it. ``cores`` asks Snakemake for the cores.
        """
        count = _count(cores)
        try:
            settings = load_config(content)
            # On a cluster, shards are small, so that no job waits long for the last one.
            jobs = settings.cluster_jobs
            cluster = Cluster(jobs=jobs, cores=count) if jobs else None
            build = Build.load(settings, cluster)
            if is_main:
                _check_presence(build)
        except UserError as error:
            sys.exit(f"error: {config.located(str(error))}")
        return cls(config, build, cluster, folder, count, is_main, marks)

    # The configuration.

    @property
    def settings(self) -> Configuration:
        return self.build.config

    @property
    def results(self) -> str:
        return self.settings.results

    @property
    def work(self) -> str:
        return self.settings.work

    @property
    def chosen(self) -> list[Dataset]:
        """The datasets that the run makes."""
        return self.build.chosen

    @cached_property
    def rendered_scenes(self) -> list[str]:
        """The chosen scenes whose views are rendered. Imported scenes have only views."""
        return list(dict.fromkeys(d.scene_name for d in self.chosen if not d.imported))

    @property
    def probes(self) -> list[str]:
        """The probe cameras of the chosen scenes.

        Target rules name them, so that missing ones are made again.
        """
        return [f"{self.work}/{name}/probes.json" for name in self.rendered_scenes]

    @property
    def runs_here(self) -> bool:
        """Whether all jobs run on this machine."""
        return self.cluster is None

    # Where everything lies.

    @cached_property
    def paths(self) -> Paths:
        """The paths of a dataset, with wildcards."""
        return Paths(self.results, self.work)

    @property
    def scripts(self) -> str:
        """The folder of the programs, quoted for commands."""
        return self._quoted(self.folder / "scripts")

    @property
    def benchmarks(self) -> str:
        """The folder of the measurements' programs, quoted for commands."""
        return self._quoted(self.folder / "benchmarks")

    def _quoted(self, path: Path) -> str:
        """Return a path relative to Snakemake's folder, which may be a user's own."""
        return shlex.quote(os.path.relpath(path))

    @property
    def removed(self) -> str:
        """The folder to which damaged files are moved, so that nobody loses anything."""
        return f"{self.work}/removed"

    def log_of(self, job: Job | str) -> str:
        """Return the log of a job, with wildcards. A job without a record has a name."""
        return f"{self.work}/logs/{job if isinstance(job, str) else job.name}.log"

    def times_of(self, job: Job) -> str:
        """Return the TSV in which Snakemake writes a job's time and memory, with wildcards."""
        return f"{self.work}/benchmarks/{job.times or job.name}.tsv"

    @cached_property
    def blends(self) -> dict[str, str]:
        """The scenes of the users' .blend files, by path. Several scenes may share one."""
        scenes = self.build.scenes
        return {d.source.blend: name for name, d in scenes.items() if d.source.blend}

    @property
    def missing_blends(self) -> list[str]:
        """The users' .blend files that must be downloaded.

        Only a file that is missing is downloaded. Snakemake removes a rule's output before it makes
        it again, as with --forceall, and a user's file may be the work of weeks.
        """
        scenes = self.build.scenes
        return [
            blend
            for blend, name in self.blends.items()
            if scenes[name].source.url and not Path(blend).exists()
        ]

    # The machine.

    @cached_property
    def memory(self) -> int:
        """The memory of this machine in bytes."""
        return available()

    @cached_property
    def local_gpus(self) -> list[gpus.Gpu]:
        """The GPUs of this machine. Empty on a cluster, whose nodes count their own."""
        return gpus.visible(self.settings.device) if self.runs_here else []

    @property
    def gpus(self) -> int:
        """How many GPUs each render takes. It waits until they are free."""
        return 1 if self.local_gpus or self.settings.device not in ("auto", "cpu") else 0

    @property
    def gpu(self) -> dict[str, int]:
        """The resource of jobs that render.

        Without GPUs the resource is left out, so that a profile's default counts.
        """
        return {"gpu": self.gpus} if self.gpus else {}

    # Only the datasets tell whether a path is a rig with frames, or a dataset without. So these are
    # constraints on both wildcards, written at ``scene``. A ruleorder comes too late for this:
    # Snakemake first asks for the inputs of every rule that matches, and one of them would refuse.

    @cached_property
    def _sequences(self) -> str:
        datasets = self.build.datasets.values()
        return one_of({d.sequence_name for d in datasets if d.sequence_exports})

    @property
    def scene_of_sequence(self) -> str:
        return rf"(?=(?:{self._sequences})/[^/]+$)[A-Za-z0-9_-]+"

    @property
    def scene_of_dataset(self) -> str:
        return rf"(?!(?:{self._sequences})/[^/]+$)[A-Za-z0-9_-]+"

    @cached_property
    def constraints(self) -> dict[str, str]:
        """The regular expressions of all wildcards."""
        return {
            "name": "[A-Za-z0-9_-]+",
            "scene": "[A-Za-z0-9_-]+",
            # A sequence's datasets lie a folder deeper, one for each frame.
            "rig": r"[A-Za-z0-9_.-]+(/f\d{5,7})?",
            # The receipts of the views lie beside the receipts of the reprojections.
            "reprojection": rf"(?!f\d{{5,7}}/|{FLOW.name}/|{RENDERED}/|panorama/)[A-Za-z0-9_.-]+",
            # Of an export: nothing for the views, or a reprojection's name and a slash.
            "source": r"((?!f\d{5,7}/)[A-Za-z0-9_.-]+/)?",
            "format": "[a-z0-9_]+",
            "first": r"\d+",
            "end": r"\d+",
            "family": one_of(self.build.family_names),
            "batch": r"(seeds|models)_\d+_(of_)?\d+",
        }

    # What the build says of a job.

    def asked(self, question: Question[Answer], wildcards: HasWildcards) -> Answer:
        """Return what a function of the build says of a job. Ends the run if it refuses the job."""
        with ending_run():
            return question(dict(wildcards.items()))

    def of_build(self, question: Question[Answer]) -> Callable[[HasWildcards], Answer]:
        """Return an input function: it returns what a function of the build says of the job."""
        return lambda wildcards: self.asked(question, wildcards)

    def of_dataset(self, attribute: str) -> Callable[[HasWildcards], Any]:
        """Return an input function: it returns an attribute of the job's dataset.

        A file that the dataset lacks is an empty list.
        """
        value = attrgetter(attribute)
        return self.of_build(lambda names: value(self.build.dataset(names)) or [])

    def of_first(self, attribute: str) -> Callable[[HasWildcards], Any]:
        """Return an input function: an attribute of the dataset with the views of the probes."""
        value = attrgetter(attribute)
        return self.of_build(lambda names: value(self.build.first_of_scene(names["scene"])) or [])

    # The files of a scene, which may be the user's own, on the machine that runs Snakemake.

    def builder_of(self, wildcards: HasWildcards) -> Any:
        """Return the files of a user's own builder."""
        return self.asked(self.build.scene, wildcards).builder_files

    def model_of(self, wildcards: HasWildcards) -> Any:
        """Return the model of a scene."""
        return self.marks.local(self.asked(self.build.scene, wildcards).source.model)

    def light_of(self, wildcards: HasWildcards) -> Any:
        """Return the picture that lights a scene's model. Empty for a light that has a name."""
        light_file = self.asked(self.build.scene, wildcards).source.light_file
        return self.marks.local(light_file) if light_file else []

    def checked_blend_of(self, wildcards: HasWildcards) -> Any:
        """Return a user's own .blend."""
        return self.marks.local(self.asked(self.build.scene, wildcards).blend)

    def blend_check_of(self, wildcards: HasWildcards) -> Any:
        """Return the proof that a user's .blend is the expected one."""
        return self.asked(self.build.scene, wildcards).blend_check or []

    def blend_of(self, wildcards: HasWildcards) -> Any:
        """Return a scene's .blend. A user's own file is on the machine that runs Snakemake."""
        dataset = self.asked(self.build.scene, wildcards)
        return self.marks.local(dataset.blend) if dataset.source.blend else dataset.blend or []


def _count(cores: Callable[[], int]) -> int:
    """Return the cores that Snakemake has. 1 for commands that run no job, such as --summary."""
    try:
        return cores()
    except Exception:
        return 1


def _check_presence(build: Build) -> None:
    """Raise `UserError` for a missing file that the run is made from."""
    presence.check_notes(NOTES / "metadata")
    for dataset in build.chosen:
        presence.check_presence(dataset)
    for name, family in build.families.items():
        presence.check_lights(name, family)
