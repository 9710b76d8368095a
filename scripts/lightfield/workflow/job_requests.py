"""The cores, memory and time that jobs ask for, by what they are expected to cost."""

from collections.abc import Callable
from functools import partial

from lightfield.core.gpus import CUDA
from lightfield.planning.cost import Cost, rendering, shard_threads
from lightfield.planning.time_limits import limit_of_render, minutes_of_reprojection
from lightfield.workflow.jobs import RENDER_PANORAMA, Job
from lightfield.workflow.run import HasWildcards, Run


class JobRequests:
    """The resource functions of a run's rules."""

    def __init__(self, run: Run) -> None:
        self._run = run

    def memory_of(self, job: Job) -> Callable[[HasWildcards, int], int]:
        """Return the resource function of a job's memory in MB. Each new attempt gets more."""
        return lambda wildcards, attempt: self._cost_of(job, wildcards).megabytes(attempt)

    def minutes_of(self, job: Job) -> Callable[[HasWildcards, int], int]:
        """Return the resource function of a job's time limit in minutes. The job renders."""

        def minutes(wildcards: HasWildcards, threads: int) -> int:
            cost = self._cost_of(job, wildcards)
            cluster = self._run.cluster
            if cluster is None:
                return cost.most_minutes(threads)
            dataset = self._run.asked(self._run.build.dataset, wildcards)
            speed = max(threads, cluster.speed) if cluster.has_gpus else threads
            return cost.most_minutes(speed, limit_of_render(dataset))

        return minutes

    @property
    def reprojection_limit(self) -> dict[str, Callable[[HasWildcards], int]]:
        """The resource of a reprojection's time limit.

        It is left out if the partition has no limit, so that a profile's default counts.
        """
        run = self._run
        if run.cluster is None or run.cluster.minutes is None:
            return {}
        return {
            "runtime": lambda wildcards: (
                minutes_of_reprojection(run.asked(run.build.dataset, wildcards)) or 1
            )
        }

    def _cost_of(self, job: Job, wildcards: HasWildcards) -> Cost:
        """Return the cost of a job."""
        assert job.cost
        return self._run.asked(partial(job.cost, self._run.build), wildcards)

    def threads_of_shard(self, wildcards: HasWildcards) -> int:
        """Return the cores of each shard, so that the shards at work fit this machine."""
        run = self._run
        shards = sum(len(dataset.shards) for dataset in run.chosen)
        need = rendering(run.asked(run.build.dataset, wildcards)).memory_bytes
        threads = shard_threads(run.cores, shards, need, run.memory)
        # On each GPU one shard renders, and another one starts. More would only wait.
        gpus = self._used_gpus
        return max(threads, run.cores // (2 * gpus)) if gpus else threads

    def threads_of_panorama(self, wildcards: HasWildcards) -> int:
        """Return the cores of each panorama, so that the panoramas at work fit this machine.

        A run's only panorama takes all cores, and the views wait for it. A GPU renders both.
        """
        run = self._run
        panoramas = sum(dataset.panorama is not None for dataset in run.chosen)
        jobs = run.cores if self._used_gpus else panoramas
        need = self._cost_of(RENDER_PANORAMA, wildcards).memory_bytes
        return shard_threads(run.cores, jobs, need, run.memory)

    @property
    def _used_gpus(self) -> int:
        """The number of this machine's GPUs that Cycles renders on."""
        # Cycles may be unable to use an AMD GPU, unless the user names its kind.
        is_hip = self._run.settings.device == "hip"
        return sum(each.variable == CUDA or is_hip for each in self._run.local_gpus)

    def threads_of_batch(self, wildcards: HasWildcards) -> int:
        """Return the cores of each batch: one, or more if there are fewer batches than cores."""
        return max(1, self._run.cores // self._run.build.batch_count)

    def stall_seconds(self, wildcards: HasWildcards) -> int:
        """Return the seconds after which a view counts as hung.

        On this machine it is 0, which means never: the user may suspend and continue a build.
        """
        a_view = rendering(self._run.asked(self._run.build.dataset, wildcards), views=1)
        return 0 if self._run.runs_here else a_view.stall_seconds
