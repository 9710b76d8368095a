#!/bin/sh
# How a Slurm job is doing, as Snakemake wants to hear it: running, success or failed.
state=$(squeue --noheader --states=all --format=%T --jobs="$1" 2>&1)
case $state in
    COMPLETED) echo success ;;
    BOOT_FAIL | CANCELLED | DEADLINE | FAILED | NODE_FAIL | OUT_OF_MEMORY | PREEMPTED | TIMEOUT) echo failed ;;
    # Long forgotten: if it did succeed, the job submitted in its place finds its work done.
    *"Invalid job id"*) echo failed ;;
    # Also when the controller does not answer: Snakemake asks again.
    *) echo running ;;
esac
