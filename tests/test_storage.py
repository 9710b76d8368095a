"""A build whose jobs see no common folder, by a storage in a folder."""

from collections import Counter

import pytest
from checkouts import wait_until

from cloud import Cloud, kill_group
from lightfield.dataset import records
from lightfield.dataset.view_store import ViewStore

PANORAMAS = "smoke/LFLattice_2panos"
WORDS = (
    *("--config", "scenes=smoke", "rigs=LFLattice_2panos", "preset=full"),
    *("--groups", "render=shard", "reproject=shard", "--"),
    f"results/{PANORAMAS}/validation.json",
)


@pytest.mark.slow
def test_a_build_in_isolated_folders_loses_no_view_when_its_jobs_are_killed(smoke, tmp_path):
    folder = tmp_path / "store"
    build, store = Cloud(tmp_path / "cloud", 2, str(folder)), ViewStore(str(folder))
    run, keys = build.start(*WORDS), folder / "views/keys"
    wait_until(lambda: any(keys.glob("*/*.exr@*")), run)
    for group in build.running():
        kill_group(group)
    kept = {path.name.split("@")[1].removesuffix(".exr") for path in keys.glob("*/*.exr@*")}
    # As a node that is gone: what is made afterwards is in the journals of other jobs.
    build.jobs.rename(tmp_path / "gone")
    build.jobs.mkdir()
    said, _ = run.communicate()
    assert run.returncode == 0, said
    assert build.made() == Counter({"view_0000f", "view_0001f"} - kept)

    for stage in ("render", "perspective"):
        record = f"work/{PANORAMAS}/{stage}/0-2.json"
        found = records.checksums(folder / record)
        assert found == records.checksums(smoke / record)
        for name, digest in found.items():
            assert store.take(digest, tmp_path / name)
            assert (tmp_path / name).read_bytes() == (
                smoke / "results" / PANORAMAS / name
            ).read_bytes()
