# make             sets up the environment and builds the default dataset
# make test        sets up and runs the checks and tests
# make test-other  runs mypy, and the tests that are not slow, with the other supported Python
# make test-snakemakes  builds the smoke scene with the oldest and the newest Snakemake
# make consumers   reads exports with the consumers' own code, in an environment of its own
# make extension   writes the Blender extension that draws rigs, in build/
# make docs        builds the documents as a site with a search, in site/

CORES ?= $(shell getconf _NPROCESSORS_ONLN)

export PATH := $(CURDIR)/.venv/bin:$(PATH)

PIP = .venv/bin/pip -qq --disable-pip-version-check
# Compiles an environment's packages on all cores. pip would take one. Some packages bring files that
# are no valid Python, so errors do not count.
COMPILE = bin/python -m compileall -qq -j 0
# Through a link, a new environment would clear that of another checkout. $(@D) is the environment.
NO_LINK = test ! -L $(@D) || { \
	echo "error: $(@D) is a link to $$(readlink $(@D)), which make would replace: remove the link" >&2; exit 1; }
# Some containers set this variable. Each of the tests' processes would then compile the code anew.
PYTEST = env -u PYTHONDONTWRITEBYTECODE python -m pytest
# The version of the environment's Python, as in the locks' names, and the other supported version.
VERSION = $$(.venv/bin/python -c 'import sys; print("%d.%d" % sys.version_info[:2])')
OTHER = $$(test $(VERSION) = 3.13 && echo 3.11 || echo 3.13)
# Snakemake finds logger plugins only in its environment, and passes over editable installs.
PLUGIN = envs/snakemake_logger_plugin_plenoforge
INSTALL_PLUGIN = cp -R $(PLUGIN) \
	"$$($(@D)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
LOCK = uv pip compile --generate-hashes --no-emit-index-url --no-header --quiet

.PHONY: all test test-other test-snakemakes check consumers soak docs extension locks

all: .venv/complete
	snakemake --cores $(CORES)

test: check
	python envs/check_system.py --tests
	@# Two processes more than cores, because some tests wait: for Slurm, killed jobs, or a browser.
	$(PYTEST) -n $$(( $(CORES) + 2 ))

test-other: export PATH := $(CURDIR)/.venv-other/bin:$(PATH)
test-other: .venv-other/complete
	@# Its numpy has other types.
	mypy scripts/lightfield
	$(PYTEST) -n $(CORES) -m "not slow"

# The oldest is the one that the Snakefile asks for.
test-snakemakes: .venv-snakemake-9.20/complete .venv-snakemake-9/complete
	rm -rf work/snakemakes
	@set -e; for version in 9.20 9; do \
		export PATH=$(CURDIR)/.venv-snakemake-$$version/bin:$$PATH; \
		tests/build_and_break.sh work/snakemakes/$$version $(CORES); \
		echo "smoke builds with Snakemake $$(snakemake --version)"; \
	done

# Style, types, and Snakemake's own advice.
check: .venv/complete-for-tests
	ruff check .
	ruff format --check .
	mypy scripts/lightfield
	snakefmt --check Snakefile rules workflow
	snakemake --lint

consumers: .venv/complete .venv-consumers/complete
	python tests/consumers/export.py work/consumers
	.venv-consumers/bin/python -W ignore tests/consumers/check.py work/consumers

# Several GB: for Linux, the package index only has torch with CUDA.
.venv-consumers/complete: .venv/packages envs/requirements-consumers.txt envs/requirements-nerfstudio.txt
	@$(NO_LINK)
	.venv/bin/python -m venv --clear .venv-consumers
	.venv-consumers/bin/pip -q install --require-hashes -r envs/requirements-consumers.txt
	.venv-consumers/bin/pip -q install --require-hashes --no-deps -r envs/requirements-nerfstudio.txt
	@touch $@

# The search needs a server: python -m http.server --directory site
docs: export NO_MKDOCS_2_WARNING = 1
docs: .venv-docs/complete
	.venv-docs/bin/mkdocs build --strict --quiet
	@echo "site/index.html"

# PYTHON names any Python from 3.11 with pip. It downloads the packages that Blender's Python lacks.
extension:
	"$$(envs/find_python.sh $(PYTHON))" extension/build.py build

# Builds that are killed, damaged and left with full disks; then a family of 200 models, some broken.
soak: .venv/complete
	python benchmarks/soak.py
	rm -rf work/soak
	python benchmarks/corpus.py --output work/soak --views 4 --samples 1

# PYTHON names an interpreter. Without it, envs/find_python.sh chooses one.
.venv/packages: envs/requirements-3.13.txt envs/requirements-3.11.txt
	@$(NO_LINK)
	@set -e; python=$$(envs/find_python.sh $(PYTHON)); \
	echo "setting up .venv with $$python: some minutes, mostly to download 400 MB"; \
	"$$python" envs/check_system.py; \
	"$$python" -m venv --clear .venv
	@$(PIP) install --no-compile --require-hashes -r envs/requirements-$(VERSION).txt
	@.venv/$(COMPILE) .venv/lib || true
	@touch $@

.venv/complete: .venv/packages $(PLUGIN)/__init__.py
	@$(INSTALL_PLUGIN)
	@touch $@

.venv/complete-for-tests: .venv/complete envs/requirements-test-3.13.txt envs/requirements-test-3.11.txt
	@$(PIP) install --no-compile --require-hashes -r envs/requirements-test-$(VERSION).txt
	@.venv/$(COMPILE) .venv/lib || true
	@touch $@

.venv-other/packages: .venv/packages envs/requirements-test-3.13.txt envs/requirements-test-3.11.txt
	@$(NO_LINK)
	@set -e; python=$$(envs/find_python.sh $(OTHER)); \
	echo "setting up .venv-other with $$python: some minutes, mostly to download 400 MB"; \
	"$$python" envs/check_system.py; \
	"$$python" -m venv --clear .venv-other
	@.venv-other/bin/pip -qq --disable-pip-version-check install --no-compile --require-hashes \
		-r envs/requirements-test-$(OTHER).txt
	@.venv-other/$(COMPILE) .venv-other/lib || true
	@touch $@

.venv-other/complete: .venv-other/packages $(PLUGIN)/__init__.py
	@$(INSTALL_PLUGIN)
	@touch $@

# The other packages are those of .venv.
.venv-snakemake-%/complete: .venv/packages $(PLUGIN)/__init__.py
	@$(NO_LINK)
	.venv/bin/python -m venv --clear $(@D)
	$(@D)/bin/pip -qq --disable-pip-version-check install 'snakemake==$*.*'
	@$(INSTALL_PLUGIN)
	@.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))' \
		> $(@D)/lib/python$(VERSION)/site-packages/others.pth
	@touch $@

# For Slurm.
.venv/complete-with-slurm: .venv/complete envs/requirements-slurm-3.13.txt envs/requirements-slurm-3.11.txt
	@$(PIP) install --require-hashes -r envs/requirements-slurm-$(VERSION).txt
	@touch $@

# For machines without a common folder.
.venv/complete-with-storage: .venv/complete envs/requirements-storage-3.13.txt envs/requirements-storage-3.11.txt
	@$(PIP) install --require-hashes -r envs/requirements-storage-$(VERSION).txt
	@touch $@

# The S3 server of benchmarks/cloud.py needs other versions of the environment's packages.
.venv-s3-server/complete: .venv/packages envs/requirements-s3-server.txt
	@$(NO_LINK)
	.venv/bin/python -m venv --clear .venv-s3-server
	.venv-s3-server/bin/pip -qq --disable-pip-version-check install --require-hashes \
		-r envs/requirements-s3-server.txt
	@touch $@

.venv-docs/complete: .venv/packages envs/requirements-docs.txt
	@$(NO_LINK)
	.venv/bin/python -m venv --clear .venv-docs
	.venv-docs/bin/pip -qq --disable-pip-version-check install --require-hashes -r envs/requirements-docs.txt
	@touch $@

# Add new packages to the locks. Delete a lock to renew all its packages. Needs uv.
locks:
	for version in 3.13 3.11; do \
		$(LOCK) --python-version $$version envs/requirements-test.in -o envs/requirements-test-$$version.txt && \
		for lock in requirements requirements-slurm requirements-storage; do \
			$(LOCK) --python-version $$version envs/$$lock.in \
				--constraints envs/requirements-test-$$version.txt -o envs/$$lock-$$version.txt || exit; \
		done; \
	done
	echo uv | $(LOCK) --universal - -o envs/requirements-uv.txt
	$(LOCK) --universal --python-version 3.11 envs/requirements-docs.in -o envs/requirements-docs.txt
	$(LOCK) --universal --python-version 3.11 envs/requirements-consumers.in -o envs/requirements-consumers.txt
	printf 'nerfstudio==1.1.5\nnerfbaselines\n' | $(LOCK) --universal --no-deps --python-version 3.11 - -o envs/requirements-nerfstudio.txt
	echo 'moto[server]' | $(LOCK) --universal --python-version 3.11 - -o envs/requirements-s3-server.txt
