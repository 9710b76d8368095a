"""The engine of jobs: stages and their flags, what a job read and made, and bundles of it."""
