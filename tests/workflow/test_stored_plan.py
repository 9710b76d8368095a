"""With a storage, the receipts and bundles of the jobs that made an input travel with it."""

import pytest
from checkouts import ROOT

from lightfield.configuration.config_file import load_config, read_config
from lightfield.core.names import ROOT as FOLDER
from lightfield.workflow.build import Build
from lightfield.workflow.jobs import PAGE
from lightfield.workflow.run import Marks, Run
from lightfield.workflow.run_config import RunConfig
from lightfield.workflow.stored_plan import plan_of

RIG = "smoke/LFCuboid_1x1x1"
SEQUENCE = "garden_sequence/LFCuboid_8panos"
# What a job reads, and the receipt of the job that made it. A mark says that a bundle comes along.
MADE = {
    f"results/{RIG}/lightfield.json": f"{RIG}/lightfield +",
    f"results/{RIG}/perspective/lightfield.json": f"{RIG}/perspective/lightfield",
    f"results/{RIG}/perspective/transforms.json": f"{RIG}/perspective/export_instant_ngp +",
    f"results/{RIG}/transforms.json": f"{RIG}/export_instant_ngp +",
    f"results/{RIG}/exports/nerfstudio/export.json": f"{RIG}/export_nerfstudio +",
    f"results/{RIG}/perspective/exports/hci/export.json": f"{RIG}/perspective/export_hci +",
    f"results/{RIG}/mesh/export.json": f"{RIG}/mesh +",
    f"results/{RIG}/validation.json": f"{RIG}/validate",
    f"results/{SEQUENCE}/f00001/validation.json": f"{SEQUENCE}/f00001/validate",
    f"results/{SEQUENCE}/validation.json": f"{SEQUENCE}/validate_sequence",
    f"results/{SEQUENCE}/exports/dnerf/export.json": f"{SEQUENCE}/sequence_dnerf +",
    "work/smoke/inventory.json": "smoke/inventory +",
    f"work/receipts/{RIG}/render/0-6.jsonl": f"{RIG}/render/0-6 +",
    f"work/receipts/{RIG}/flow/0-6.jsonl": f"{RIG}/flow/0-6 +",
    f"work/receipts/{RIG}/perspective/0-6.jsonl": f"{RIG}/perspective/0-6 +",
    f"results/{RIG}/sha256sums.txt": None,
    f"work/{RIG}/panorama/lightfield.json": None,
}


@pytest.fixture
def plan(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert FOLDER == ROOT
    content = read_config(ROOT / "config.yaml")
    content |= {"scenes": ["smoke", "garden_sequence"], "rigs": "all", "preset": "full"}
    content["storage"] = str(tmp_path / "store")
    build = Build.load(load_config(content))
    marks = Marks(*[lambda file: file] * 4)
    return plan_of(Run(RunConfig(ROOT, {}), build, None, ROOT, 2, True, marks))


@pytest.mark.parametrize("path", MADE)
def test_the_maker_of_an_input_travels_with_it(plan, path):
    inputs = plan.reads(PAGE, file=path)({"scene": "smoke", "rig": "LFCuboid_1x1x1"})
    job, _, has_bundle = (MADE[path] or "").partition(" ")
    stem = f"work/receipts/{job}"
    assert inputs["makers"] == ([f"{stem}.jsonl"] if job else [])
    assert inputs["bundles"] == ([f"{stem}.tar"] if has_bundle else [])


def test_a_job_that_reads_only_receipts_gets_no_bundles(plan):
    receipt = f"work/receipts/{RIG}/render/0-6.jsonl"
    inputs = plan.reads(PAGE, receipts=[receipt])({"scene": "smoke", "rig": "LFCuboid_1x1x1"})
    assert inputs["makers"] == [receipt]
    assert inputs["bundles"] == []
