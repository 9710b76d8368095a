# `make` sets up the environment and builds the default dataset; `make test` sets up and runs the tests.

PYTHON ?= $(shell command -v python3.11 || echo python3)
CORES ?= $(shell getconf _NPROCESSORS_ONLN)

export PATH := $(CURDIR)/.venv/bin:$(PATH)

.PHONY: all test check

all: .venv/complete
	snakemake --cores $(CORES)

test: check
	python -m pytest -n $(CORES)

# Style, types, and Snakemake's own advice.
check: .venv/complete
	ruff check .
	ruff format --check .
	mypy scripts/lightfield
	snakefmt --check Snakefile rules
	snakemake --lint

.venv/complete: envs/requirements.txt envs/check_system.py
	$(PYTHON) envs/check_system.py
	$(PYTHON) -m venv --clear .venv
	.venv/bin/pip install --quiet --disable-pip-version-check --require-hashes -r envs/requirements.txt
	touch .venv/complete
