"""What Snakemake's workflow catalog asks for, and the workflow as users of the catalog run it.

Its program is scripts/generate-catalog.py of github.com/snakemake/snakemake-workflow-catalog. Users
get their Snakefile from snakedeploy.
"""

import shutil
import subprocess

import pytest
import yaml
from checkouts import ROOT, checkout

from lightfield.configuration.config_file import load_config, read_config
from lightfield.core.files import read_text
from promises.test_own_folder import SCENE, snakemake

# As snakedeploy writes it.
DEPLOYED = """
from snakemake.utils import min_version

min_version("6.10.0")

configfile: "config/config.yaml"

module plenoforge:
    snakefile: github("somebody/plenoforge", path="workflow/Snakefile", tag="v1")
    config: config

use rule * from plenoforge
"""
# As config/README.md says.
HANDLERS = """
onstart: plenoforge.onstart()
onsuccess: plenoforge.onsuccess()
onerror: plenoforge.onerror()
"""


def test_the_catalog_finds_what_standardized_usage_needs():
    assert (ROOT / "workflow/Snakefile").is_file()
    assert read_text(ROOT / "config/README.md").startswith("# ")
    readme = read_text(ROOT / "README.md").lower()
    assert "snakemake" in readme
    assert "workflow" in readme
    usage = yaml.safe_load(read_text(ROOT / ".snakemake-workflow-catalog.yml"))["usage"]
    assert usage["software-stack-deployment"].keys() == {"conda", "apptainer", "apptainer+conda"}
    assert usage["mandatory-flags"].keys() == {"desc", "flags"}


def test_the_configuration_that_users_get_is_right():
    written = read_config(ROOT / "config/config.yaml")
    settings = load_config({**read_config(ROOT / "config.yaml"), **written})
    assert settings.scenes == written["scenes"]


def git(folder, *arguments):
    identity = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    command = ["git", "-C", folder, *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.slow
def test_a_deployed_workflow_builds_datasets_with_the_programs_of_the_repository(
    tmp_path, monkeypatch
):
    repository = checkout(tmp_path / "hosted/somebody/plenoforge")
    shutil.copytree(ROOT / "workflow", repository / "workflow")
    git(repository, "init", "--quiet")
    git(repository, "add", "--all")
    git(repository, "commit", "--quiet", "--message", "All")
    commit = git(repository, "rev-parse", "HEAD")
    git(repository, "tag", "v1")
    # Git finds the repository here instead of at GitHub, and Snakemake keeps its clone here.
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.file://{tmp_path}/hosted/.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", "https://github.com/")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    folder = tmp_path / "project"
    for name, text in {
        "workflow/Snakefile": DEPLOYED + HANDLERS,
        "config/config.yaml": "scenes: [mine]\nrigs: all\npreset: full\n",
        "configs/scenes/mine.yaml": SCENE,
        "poses/mine.csv": "name,x,y,z,rx,ry,rz\none,0,0,1.3,1.6,0,0\n",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    code, said = snakemake("--cores", "2", cwd=folder)
    assert code == 0, said
    assert "\nvalid: results/mine/LFOwn/report/index.html\n" in said
    assert (folder / "results/mine/LFOwn/sha256sums.txt").is_file()
    unpacked = folder / ".snakemake/plenoforge"
    assert [path.name for path in unpacked.iterdir()] == [commit]
    code, said = snakemake("--cores", "1", "--dry-run", cwd=folder)
    assert (code, "Nothing to be done" in said) == (0, True), said
