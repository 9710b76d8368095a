#!/bin/sh
# Print the state of a Slurm job in Snakemake's words: running, success or failed.
state=$(squeue --noheader --states=all --format=%T --jobs="$1" 2>&1)
case $state in
    COMPLETED) echo success ;;
    BOOT_FAIL | CANCELLED | DEADLINE | FAILED | NODE_FAIL | OUT_OF_MEMORY | PREEMPTED | TIMEOUT) echo failed ;;
    # Slurm has forgotten the job. If it succeeded, the job in its place finds its work done.
    *"Invalid job id"*) echo failed ;;
    # If the controller does not answer, too: Snakemake asks again.
    *) echo running ;;
esac
