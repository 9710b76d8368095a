# Plenoforge: scene YAMLs in configs/scenes/ become light-field datasets in results/.
import sys
from pathlib import Path

sys.path.insert(0, f"{workflow.basedir}/scripts")

from lightfield.core.errors import UserError
from lightfield.dataset.config import read_config

# What the command line says; config.yaml fills in the rest.
GIVEN = set(config)


# The defaults, and what a user's own folder says instead.
configfile: f"{workflow.basedir}/config.yaml"


if Path("config.yaml").exists() and Path.cwd() != Path(workflow.basedir):

    # Snakemake loads it without a limit.
    try:
        read_config(Path("config.yaml"))
    except UserError as error:
        sys.exit(f"error: {error}")

    configfile: "config.yaml"


report: "captions/workflow.rst"


include: "rules/common.smk"
include: "rules/storage.smk"
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
include: "rules/benchmark.smk"
include: "rules/error.smk"
include: "rules/synthesis.smk"


onstart:
    try:
        check_device()
        check_room()
        if STORE:
            ViewStore(STORE).check()
        remove_leftovers()
        for path in BROKEN:
            set_aside(Path(path), Path(REMOVED))
        if SETTINGS.accept_blend:
            for name in SCENES:
                accept_blend(name)
    except UserError as error:
        sys.exit(f"error: {error}")
    begin_display()


onsuccess:
    end_display()
    note_sums()
    print_pages()


onerror:
    end_display()
    note_sums()
    # Snakemake has something to say after this, too: what failed is repeated when it has.
    atexit.register(
        print, failure_report(failed_jobs()), file=sys.stderr, flush=True
    )


rule all:
    default_target: True
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in CHOSEN],
        f"{RESULTS}/index.html",
        whole(CHOSEN),


rule report_html:
    input:
        [dataset.page for dataset in CHOSEN],
        f"{RESULTS}/index.html",
        whole(CHOSEN),


rule smoke:
    input:
        [[*dataset.files, *dataset.intermediates] for dataset in SMOKE],
        whole(SMOKE),


# What its jobs are is not known before: it reads what is there, also of an unfinished build.
rule verify:
    log:
        log_of("verify"),
    conda:
        ENVIRONMENT
    params:
        folders=shlex.join(dataset.folder for dataset in CHOSEN),
        work=WORK,
    message:
        "Checking every byte of the chosen datasets"
    shell:
        f"python {SCRIPTS}/verify.py"
        " {params.folders} --work {params.work} > {log} 2>&1"


rule package:
    input:
        [dataset.package for dataset in CHOSEN],
        whole(CHOSEN),
