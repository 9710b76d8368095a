"""Runs the jobs that make the datasets of one member, in this process.

So Blender is loaded once for many members. Each stage that needs the scene opens its .blend anew,
as the jobs of other scenes do. The stages have no receipts of their own: what they read and make is
in the member's receipt.
"""

import time

from lightfield.stages.views import Device
from lightfield.workflow.build import Build
from lightfield.workflow.jobs import jobs_of


class MemberRun:
    """A run of a member's jobs. ``stage`` is the stage of the job at work, or of the last one.

    ``seconds`` are the CPU seconds of each stage.
    """

    def __init__(self) -> None:
        self.stage = "settings"
        self.seconds: dict[str, float] = {}

    def run(self, build: Build, device: Device, threads: int) -> None:
        """Run the jobs of a build in the order of the work, and name the stage of each in the log.

        ``device`` renders, with as many ``threads`` on the CPU.
        """
        machine = {"device": device, "threads": threads}
        for job, wildcards, fields in jobs_of(build):
            self.stage = job.stage.name
            print(f"stage: {self.stage}", flush=True)
            began = time.process_time()
            options = {key: machine[key] for key in machine if key in job.stage.model_fields}
            try:
                job.stage_of(build, wildcards, fields | options).run()
            finally:
                seconds = self.seconds.get(self.stage, 0.0) + time.process_time() - began
                self.seconds[self.stage] = round(seconds, 4)
