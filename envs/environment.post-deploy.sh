# Snakemake runs this in the workflow's folder once it has made the environment.
set -e
python -m pip install --require-hashes -r envs/requirements-3.13.txt
