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

from lightfield.workflow.run_config import RunConfig

# Jobs start in the folder of the run. Bash would first run this script, which may leave the folder.
os.environ.pop("BASH_ENV", None)

CONFIG = RunConfig(FOLDER, config)


configfile: f"{FOLDER}/config.yaml"


if CONFIG.has_own:

    configfile: "config.yaml"


CONFIG.complete(config)


report: "captions/workflow.rst"


# With --software-deployment-method apptainer, each job runs in the image of envs/plenoforge.def.
# Snakemake refuses a path with blanks, also if no job runs in a container.
IMAGE = f"{FOLDER}/envs/plenoforge.sif"


container: IMAGE if " " not in IMAGE else "plenoforge.sif"


include: "rules/common.smk"
include: "rules/shell.smk"
include: "rules/settings.smk"
include: "rules/scene.smk"
include: "rules/rig.smk"
include: "rules/corners.smk"
include: "rules/render.smk"
include: "rules/reproject.smk"
include: "rules/flow.smk"
include: "rules/mesh.smk"
include: "rules/video.smk"
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


PLAN.check_provider(str(rules.index.output[0]))


onstart:
    HANDLERS.start()


onsuccess:
    HANDLERS.succeed()


onerror:
    HANDLERS.fail()


rule all:
    default_target: True
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in RUN.chosen],
        f"{RUN.results}/index.html",
        RUN.build.family_targets,
        [PLAN.batch_receipts({"family": family}) for family in RUN.build.family_names],


rule report_html:
    input:
        RUN.build.pages,
        f"{RUN.results}/index.html",


rule smoke:
    input:
        RUN.of_build(RUN.build.smoke_files),


rule package:
    input:
        RUN.of_build(RUN.build.packages),
