# Plenoforge: scene YAMLs in configs/scenes/ become light-field datasets in results/.
import sys
from pathlib import Path

# Of this workflow, which may be a module of another one.
FOLDER = Path(workflow.current_basedir)
sys.path.insert(0, str(FOLDER / "scripts"))

from lightfield.core.errors import UserError
from lightfield.core.disk_space import obstacle
from lightfield.dataset.config import as_written, read_config

# Where Snakemake can note nothing, it ends with a traceback.
if cause := obstacle(Path(".snakemake")):
    sys.exit(f"error: .snakemake: cannot be written: {cause}")

# What the command line says, or the workflow whose module this is; config.yaml fills in the rest.
GIVEN = set(config)
HAS_OWN_CONFIG = Path("config.yaml").exists() and Path.cwd() != FOLDER

# Snakemake loads both files without a limit, and does not say in which line one is wrong.
try:
    # The defaults, and what a user's own folder says instead.
    DEFAULTS = read_config(FOLDER / "config.yaml")
    OWN = read_config(Path("config.yaml")) if HAS_OWN_CONFIG else {}
except UserError as error:
    sys.exit(f"error: {error}")


configfile: f"{FOLDER}/config.yaml"


if HAS_OWN_CONFIG:

    configfile: "config.yaml"


# Snakemake reads no file for a module that is given its configuration, and takes 12:30 for 750. So
# our own reading replaces its own, and adds the defaults that it did not read.
OWN_READ = {key: value for key, value in OWN.items() if key in config}
for written in (DEFAULTS, OWN_READ):
    as_written(
        config, {key: value for key, value in written.items() if key not in GIVEN}
    )


report: "captions/workflow.rst"


include: "rules/internals.smk"


# For --software-deployment-method apptainer: each job runs in the image of envs/plenoforge.def.
# Snakemake refuses a path with blanks also where it uses no container.
container: f"{FOLDER}/envs/plenoforge.sif" if USES_CONTAINERS else "plenoforge.sif"


include: "rules/common.smk"
include: "rules/storage.smk"
include: "rules/ledger.smk"
include: "rules/start.smk"
include: "rules/failures.smk"
include: "rules/display.smk"
include: "rules/scene.smk"
include: "rules/rig.smk"
include: "rules/render.smk"
include: "rules/reproject.smk"
include: "rules/flow.smk"
include: "rules/export.smk"
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
        if SETTINGS.accept_blend:
            for name in SCENES:
                accept_blend(name)
        begin_display()
        begin_notes()
        announce_stop()
    except UserError as error:
        sys.exit(f"error: {error}")


onsuccess:
    end_display()
    end_notes()
    print_pages()


onerror:
    end_display()
    end_notes()
    # Snakemake has something to say after this, too: what failed is repeated when it has.
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


rule report_html:
    input:
        [dataset.page for dataset in CHOSEN],
        f"{RESULTS}/index.html",


rule smoke:
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in SMOKE],


rule package:
    input:
        [dataset.package for dataset in CHOSEN],
