"""Let Snakemake ask Slurm every other second how jobs are: after failures it waits minutes.

PYTHON_OF_BATCHES names the Python of the Snakemakes that only start the steps of Slurm's jobs.
"""

import asyncio
import os
import sys

sleep = asyncio.sleep
asyncio.sleep = lambda seconds, *result: sleep(min(seconds, 2), *result)
# Only the first Snakemake takes it. It does not pass the variable on.
sys.executable = os.environ.pop("PYTHON_OF_BATCHES", sys.executable)
