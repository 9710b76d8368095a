# Plenoforge: scene YAMLs in configs/scenes/ become light-field datasets in results/.
import atexit
import sys
from pathlib import Path

from snakemake.utils import min_version

min_version("9.26")

# The folder of this workflow, which may be a module of another one.
FOLDER = Path(workflow.current_basedir)
sys.path.insert(0, str(FOLDER / "scripts"))

from lightfield.configuration.config_file import read_config
from lightfield.core.disk_space import obstacle
from lightfield.core.errors import UserError
from lightfield.core.yaml_files import as_written
from lightfield.workflow.failures import failure_report
from lightfield.workflow.view_store import ViewStore

# Snakemake ends with a traceback if it cannot write its notes.
if problem := obstacle(Path(".snakemake")):
    sys.exit(f"error: .snakemake: cannot be written: {problem}")

# The keys from the command line, or from the workflow whose module this is. config.yaml fills in
# the others.
GIVEN = set(config)
HAS_OWN_CONFIG = Path("config.yaml").exists() and Path.cwd() != FOLDER

# Snakemake loads both files without a limit of size, and does not name the line of a mistake.
try:
    # The defaults, and the values of the user's own folder.
    DEFAULTS = read_config(FOLDER / "config.yaml")
    OWN = read_config(Path("config.yaml")) if HAS_OWN_CONFIG else {}
except UserError as error:
    sys.exit(f"error: {error}")


configfile: f"{FOLDER}/config.yaml"


if HAS_OWN_CONFIG:

    configfile: "config.yaml"


# Snakemake reads no file for a module with a given configuration, and reads 12:30 as 750. So this
# replaces Snakemake's values, and adds the missing defaults.
OWN_READ = {key: value for key, value in OWN.items() if key in config}
for written in (DEFAULTS, OWN_READ):
    as_written(
        config, {key: value for key, value in written.items() if key not in GIVEN}
    )


report: "captions/workflow.rst"


include: "rules/internals.smk"


# With --software-deployment-method apptainer, each job runs in the image of envs/plenoforge.def.
# Without containers the path must not have blanks either, because Snakemake checks it anyway.
container: f"{FOLDER}/envs/plenoforge.sif" if USES_CONTAINERS else "plenoforge.sif"


include: "rules/common.smk"
include: "rules/shell.smk"
include: "rules/storage.smk"
include: "rules/selectors.smk"
include: "rules/ledger.smk"
include: "rules/start.smk"
include: "rules/failures.smk"
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
include: "rules/learn.smk"


onstart:
    try:
        check_start()
        if STORE:
            ViewStore(STORE).check()
        keep_shards()
        remove_leftovers()
        announce_damage()
        set_damage_aside()
        begin_display()
        begin_notes()
        announce_stop()
    except UserError as error:
        sys.exit(f"error: {error}")


onsuccess:
    end_display()
    end_notes()
    print_pages()
    print_families()


onerror:
    end_display()
    end_notes()
    # Snakemake prints more after this. So print the failures when the process ends.
    atexit.register(
        print,
        failure_report(failed_jobs(failed_entries())) or UNFINISHED,
        file=sys.stderr,
        flush=True,
    )


rule all:
    default_target: True
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in CHOSEN],
        f"{RESULTS}/index.html",
        BUILD.family_targets,


rule report_html:
    input:
        [dataset.paths.page for dataset in CHOSEN],
        f"{RESULTS}/index.html",


rule smoke:
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in BUILD.smoke],


rule package:
    input:
        [dataset.sequence_paths.package for dataset in CHOSEN],
        BUILD.documents,
