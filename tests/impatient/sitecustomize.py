"""Let Snakemake ask Slurm every other second how jobs are: after failures it waits minutes."""

import asyncio

sleep = asyncio.sleep
asyncio.sleep = lambda seconds, *result: sleep(min(seconds, 2), *result)
