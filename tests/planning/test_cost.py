"""The cost of jobs before they run: what they need, request and may take."""

import json

import pytest
from checkouts import ROOT

from lightfield.configuration.config_file import load_config, read_config
from lightfield.planning import cost as planning
from lightfield.planning.cost import (
    Cost,
    computing_flow,
    kwh,
    rendering,
    rendering_panorama,
    reprojecting,
    view_cost,
)
from lightfield.planning.loading import scene_datasets

GB = 10**9


@pytest.mark.parametrize(
    ("cores", "shards", "need", "available", "expected"),
    [
        (64, 1000, GB, 256 * GB, 1),
        (64, 1000, 4 * GB, 64 * GB, 5),
        (7, 1000, 4 * GB, 18 * GB, 2),
        (64, 2, GB, 256 * GB, 32),
        (64, 2, 20 * GB, 25 * GB, 64),
        (2, 1000, 100 * GB, 25 * GB, 2),
        (1, 0, GB, 25 * GB, 1),
    ],
)
def test_simultaneous_jobs_fit_into_memory(cores, shards, need, available, expected):
    threads = planning.shard_threads(cores, shards, need, available)
    assert threads == expected
    assert cores // threads * need <= available or threads == cores


def test_a_job_requests_the_measured_memory_of_the_scene(tmp_path):
    content = read_config(ROOT / "config.yaml") | {"work": str(tmp_path)}
    dataset = scene_datasets("garden", settings=load_config(content))[0]
    pixels = 2048 * 2048 * planning.PIXEL_MEMORY
    tiled_pixels = 2048 * 2048 * planning.TILED_PIXEL_MEMORY
    assert rendering(dataset).memory_bytes == planning.UNKNOWN_SCENE + pixels
    (tmp_path / "garden").mkdir()
    (tmp_path / "garden/inventory.json").write_text(json.dumps({"memory_bytes": 2 * GB}))
    assert rendering(dataset).memory_bytes == 2.4 * GB + pixels
    # Four pixels for each pixel of a view, up to 4096 × 2048.
    assert rendering_panorama(dataset).memory_bytes == 2.4 * GB + pixels + tiled_pixels


def test_a_view_of_8192_pixels_fits_a_machine_on_which_it_was_rendered():
    # The room took 10.1 GB on the processor, and its file 2.7 GB.
    assert 12.8 * GB < planning.rendering_memory(0, 8192**2, denoise=False) < 16 * GB


def test_a_job_that_is_tried_again_requests_more_memory():
    a_job = Cost(memory_bytes=1_500_001)
    assert [a_job.megabytes(attempt) for attempt in (1, 2)] == [2, 4]


def test_costs_of_jobs_add_up_but_only_one_is_in_memory():
    one, other = Cost(2.0, 300, 10.0), Cost(3.0, 200, 5.0)
    assert one + other == Cost(5.0, 300, 15.0)
    assert 3 * one == Cost(6.0, 300, 30.0)


def test_the_jobs_of_a_dataset_write_together_what_a_view_takes():
    """A run checks the disk by the cost of a view, and prints the size of each phase."""
    for dataset in (*scene_datasets("smoke"), *scene_datasets("object")):
        written = rendering(dataset).disk_bytes + computing_flow(dataset).disk_bytes
        for name in dataset.reprojections:
            written += reprojecting(dataset, name).disk_bytes
        assert written == pytest.approx(dataset.view_count * view_cost(dataset).disk_bytes)


def test_a_limit_of_time_is_far_above_what_is_expected():
    day = Cost(seconds=24 * 3600)
    assert 60 * day.most_minutes(1) > 4 * day.seconds
    assert day.most_minutes(1) > 3 * day.most_minutes(4) > 3 * day.seconds / 60 / 4
    assert day.stall_seconds > 4 * day.seconds
    assert Cost().most_minutes(1) >= 30


def test_the_papers_energy_follows_from_its_days_and_watts():
    # SILVR, footnote on rendering: around 12 days at 500 W, 144 kWh.
    assert kwh(12 * 24 * 3600, watts=500) == pytest.approx(144)
