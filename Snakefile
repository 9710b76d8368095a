# Plenoforge: scene YAMLs in configs/scenes/ become light-field datasets in results/.
import os
import sys
from pathlib import Path

from snakemake.utils import min_version

min_version("9.20")

# Jobs on a cluster read this file again. They get the variable from the run.
IS_MAIN_PROCESS = "PLENOFORGE_RUN" not in os.environ
os.environ["PLENOFORGE_RUN"] = "1"


envvars:
    "PLENOFORGE_RUN",


# The folder of this workflow, which may be a module of another one.
FOLDER = Path(workflow.current_basedir)
sys.path.insert(0, str(FOLDER / "scripts"))

from lightfield.core.terminal import interrupt_once, print_everywhere

if IS_MAIN_PROCESS:
    interrupt_once()
    print_everywhere()

from lightfield.configuration.config_file import read_config
from lightfield.core.disk_space import check_folder
from lightfield.core.errors import UserError
from lightfield.core.yaml_files import as_written

if {"{", "}"} & {*str(FOLDER)}:
    sys.exit(
        f"error: {FOLDER}: the path of Plenoforge's folder has a brace, which Snakemake takes for "
        "a wildcard: rename the folder, or move it"
    )

# Jobs start in the folder of the run. Bash would first run this script, which may leave the folder.
os.environ.pop("BASH_ENV", None)

# The keys from the command line, or from the workflow whose module this is. config.yaml fills in
# the others.
GIVEN_KEYS = set(config)
HAS_OWN_CONFIG = Path("config.yaml").exists() and Path.cwd() != FOLDER
# The defaults, and before them the values of the user's own folder.
CONFIG_FILES = [FOLDER / "config.yaml"]
if HAS_OWN_CONFIG:
    CONFIG_FILES.insert(0, Path("config.yaml"))

# Snakemake ends with a traceback if it cannot write its notes. It loads both files without a limit
# of size, and does not name the line of a mistake.
try:
    check_folder(Path(".snakemake"))
    DEFAULTS = read_config(FOLDER / "config.yaml")
    USER_CONFIG = read_config(Path("config.yaml")) if HAS_OWN_CONFIG else {}
except UserError as error:
    sys.exit(f"error: {error}")


configfile: f"{FOLDER}/config.yaml"


if HAS_OWN_CONFIG:

    configfile: "config.yaml"


# Snakemake reads no file for a module with a given configuration, and reads 12:30 as 750. So this
# replaces Snakemake's values, and adds the missing defaults.
USER_VALUES = {key: value for key, value in USER_CONFIG.items() if key in config}
for written in (DEFAULTS, USER_VALUES):
    as_written(
        config, {key: value for key, value in written.items() if key not in GIVEN_KEYS}
    )


report: "captions/workflow.rst"


# With --software-deployment-method apptainer, each job runs in the image of envs/plenoforge.def.
# Snakemake refuses a path with blanks, also if no job runs in a container.
IMAGE = f"{FOLDER}/envs/plenoforge.sif"


container: IMAGE if " " not in IMAGE else "plenoforge.sif"


include: "rules/common.smk"
include: "rules/storage.smk"
include: "rules/shell.smk"
include: "rules/selectors.smk"
include: "rules/check.smk"
include: "rules/settings.smk"
include: "rules/start.smk"
include: "rules/display.smk"
include: "rules/scene.smk"
include: "rules/rig.smk"
include: "rules/render.smk"
include: "rules/reproject.smk"
include: "rules/flow.smk"
include: "rules/mesh.smk"
include: "rules/export.smk"
include: "rules/family.smk"
include: "rules/validate.smk"
include: "rules/report.smk"
include: "rules/costs.smk"
include: "rules/package.smk"
include: "rules/plan.smk"
include: "rules/error.smk"
include: "rules/benchmark.smk"
include: "rules/synthesis.smk"


# Only Snakemake's path of an output says whether it has a storage.
HAS_STORAGE = ".snakemake/storage/" in str(rules.index.output[0])
if IS_MAIN_PROCESS and STORE and not HAS_STORAGE:
    sys.exit(
        "error: storage: Snakemake has no storage: add --default-storage-provider "
        f"and --default-storage-prefix {STORE}"
    )
if IS_MAIN_PROCESS and HAS_STORAGE and not STORE:
    sys.exit(
        "error: storage: is empty, but Snakemake has a storage: add --config storage=<its place>"
    )


onstart:
    try:
        announce_changes()
        make_ways()
        run_lock.take(scene_folders())
        check_start()
        write_new_settings()
        remove_leftovers()
        begin_display()
        announce_stop()
    except UserError as error:
        sys.exit(f"error: {error}")


onsuccess:
    DISPLAY.at_close(print_results)


onerror:
    DISPLAY.at_close(print_failures)


rule all:
    default_target: True
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in CHOSEN_DATASETS],
        f"{RESULTS}/index.html",
        BUILD.family_targets,


rule report_html:
    input:
        [dataset.paths.page for dataset in CHOSEN_DATASETS],
        f"{RESULTS}/index.html",


rule smoke:
    input:
        of_build(
            lambda _: [
                path for d in BUILD.smoke for path in (*d.files, *d.intermediates)
            ]
        ),


rule package:
    input:
        [dataset.sequence_paths.package for dataset in CHOSEN_DATASETS],
        BUILD.documents,
