"""The plan before anything is rendered: the number of views, time and disk space."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from checkouts import checkout, planned, snakemake

from lightfield.configuration.config_file import Energy
from lightfield.configuration.dataset import Cluster, shard_bounds
from lightfield.core.files import write_json
from lightfield.engine import receipts
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.measurement import plan
from lightfield.measurement.equal_error import of_measurement
from lightfield.planning import time_limits
from lightfield.planning.cost import rendering
from lightfield.planning.estimate import ProbedViews, read_probe
from lightfield.planning.forecast import Request, requests_table
from lightfield.planning.loading import scene_datasets
from lightfield.rendering.views import shard
from lightfield.stages.measurement import Plan, Probe, ProbeSettings
from lightfield.workflow import shard_log
from lightfield.workflow.history import History

SILVR = ("garden", "lone_monk", "barbershop")


def test_the_rigs_are_silvrs_published_ones():
    counts = {
        (dataset.scene_folder, dataset.rig_folder): (
            dataset.view_count,
            dataset.rig.camera.lens,
            dataset.rig.camera.resolution,
        )
        for scene in SILVR
        for dataset in scene_datasets(scene)
    }
    fisheye = ("equidistant", (2048, 2048))
    evaluation = (42, "rectilinear", (2048, 2048))
    panoramas = (8, "equirectangular", (4096, 2048))
    assert counts == {
        ("garden", "LFCuboid_2x2x1"): (1806, *fisheye),
        ("garden", "LFSphere_e100cm_d170cm"): (642, *fisheye),
        ("garden", "LFSphere_e100cm_d50cm"): evaluation,
        ("garden", "LFCuboid_8panos"): panoramas,
        ("lone_monk", "LFCuboid_4mx4mx3m"): (2226, *fisheye),
        ("lone_monk", "LFSphere_e220cm_d400cm"): (642, *fisheye),
        ("lone_monk", "LFSphere_e160cm_d220cm"): evaluation,
        ("lone_monk", "LFCuboid_8panos"): panoramas,
        ("barbershop", "LFCuboid_1mx3mx1m"): (1400, *fisheye),
        ("barbershop", "LFSphere_e105cm_d145cm"): (642, *fisheye),
        ("barbershop", "LFSphere_e110cm_d100cm"): evaluation,
        ("barbershop", "LFCuboid_8panos"): panoramas,
    }
    assert sum(views for views, lens, _ in counts.values() if lens == "equidistant") == 7358


@pytest.mark.parametrize("scene", SILVR)
def test_a_spheres_name_has_its_elevation_and_diameter_in_centimetres(scene):
    spheres = [d for d in scene_datasets(scene) if "LFSphere" in d.rig_name]
    assert len(spheres) == 2
    for dataset in spheres:
        heights = [pose.position[2] for pose in dataset.rig.poses()]
        elevation, diameter = map(
            int, re.fullmatch(r"LFSphere_e(\d+)cm_d(\d+)cm", dataset.rig_name).groups()
        )
        assert (max(heights) + min(heights)) / 2 == pytest.approx(elevation / 100)
        assert max(heights) - min(heights) == pytest.approx(diameter / 100)


@pytest.fixture
def sphere(tmp_path):
    """The garden's sphere of 642 views at full size, with 6442 s each unless a probe tells more."""
    (dataset,) = (d for d in scene_datasets("garden") if d.rig_name == "LFSphere_e100cm_d170cm")
    return replace(dataset, work_root=str(tmp_path))


def test_shards_follow_from_the_jobs_of_a_cluster_and_from_a_probe(sphere):
    def count(**settings):
        return len(replace(sphere, **settings).shards)

    assert count() == 64
    # Jobs of 2 cores render a view in 54 minutes, and may take two hours.
    assert count(cluster=Cluster(jobs=100, cores=2)) == 288
    # Jobs of 16 cores would need fewer than 100, but 100 run at once.
    assert count(cluster=Cluster(jobs=100, cores=16)) == 100
    assert count(cluster=Cluster(jobs=300, cores=16)) == 300
    # Jobs of 1000 cores render a view in 6 s, and take five minutes at least.
    assert count(cluster=Cluster(jobs=100, cores=1000)) == 14
    probe = {"device": "CPU", "resolution": [2048, 2048], "samples": 256}
    probe |= {"views": 642, "view_seconds": [6.0], "view_bytes": [1e7]}
    write_json(Path(sphere.paths.probe), probe)
    # Ten views are the fewest for which the start is a small part.
    assert count() == 64
    assert count(views_per_shard=5) == 129
    # Two cores render a hundred views in five minutes.
    assert count(cluster=Cluster(jobs=100, cores=2)) == 7


@pytest.mark.parametrize("minutes", [60, 240, 480, 1440])
def test_a_shard_keeps_the_limit_of_its_partition(sphere, minutes):
    """A render and its reprojections are one job, one after the other."""
    cluster = Cluster(jobs=100, cores=16, minutes=minutes)
    limited = replace(sphere, cluster=cluster)
    reprojections = len(limited.reprojections) * time_limits.minutes_of_reprojection(limited)
    for first, end in limited.shards:
        cost = rendering(limited, end - first)
        render = cost.most_minutes(cluster.speed, time_limits.limit_of_render(limited))
        assert render + reprojections <= minutes
        expected = cost.seconds / 60 / 16
        # Several times the expected time, unless the limit is too small for it.
        assert render >= min(5 * expected, minutes - reprojections)
        assert render >= 5 * expected or end - first == 1
    assert len(limited.shards) >= len(replace(sphere, cluster=Cluster(jobs=100, cores=16)).shards)


def test_shards_of_a_cluster_with_gpus_count_a_gpus_minutes(sphere):
    """A view of 107 minutes of a core takes less than two minutes of a GPU."""
    cluster = Cluster(jobs=10, cores=2, has_gpus=True)
    on_gpus = replace(sphere, cluster=cluster)
    assert len(on_gpus.shards) == 64
    (first, end) = on_gpus.shards[0]
    on_cores = replace(sphere, cluster=Cluster(jobs=10, cores=2))
    assert len(on_cores.shards) == 288
    cost = rendering(on_gpus, end - first)
    assert cost.most_minutes(cluster.speed) < 150 < cost.most_minutes(2)


def test_the_probe_of_a_sequences_first_frame_counts_for_all_frames(tmp_path):
    datasets = scene_datasets("garden_sequence")
    frames = [
        replace(dataset, work_root=str(tmp_path))
        for dataset in datasets
        if dataset.rig_name == datasets[0].rig_name
    ]
    width, height = frames[0].rig.camera.resolution
    probe = {"device": "CPU", "resolution": [width, height], "samples": frames[0].render.samples}
    probe |= {"views": 9, "view_seconds": [6.0, 8.0], "view_bytes": [1e7]}
    write_json(Path(frames[0].paths.probe), probe)
    for frame in frames:
        ten_views, twenty_views = (rendering(frame, views) for views in (10, 20))
        assert twenty_views.seconds - ten_views.seconds == pytest.approx(70)
        assert ten_views.disk_bytes == pytest.approx(1e8)


def begin(work, dataset, shards):
    """Leave unfinished receipts of shards, as a kill does."""
    folder = Path(work, receipts.FOLDER, dataset, "render")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for first, end in shards:
        # What is in them does not matter.
        (folder / f"{first}-{end}{receipts.PART_SUFFIX}").write_text("{")


def test_a_dataset_in_progress_keeps_its_shards(sphere):
    begun = replace(sphere, cluster=Cluster(jobs=100, cores=16))
    begin(sphere.work_root, "other/rig", [(0, 3), (3, 6), (6, 10)])
    assert len(begun.shards) == 100
    begun = replace(begun)
    # A hundred jobs were at work.
    begin(sphere.work_root, sphere.name, shard_bounds(642, 400)[:100])
    assert len(begun.shards) == 400
    assert begun.shards[0][0] == 0 and begun.shards[-1][1] == 642
    assert len(replace(begun, views_per_shard=321).shards) == 2
    # The rig had more views before, or these are no bounds.
    for shards in ([(640, 650)], [(3, 1)], [(4, 4)], [("a", "b")]):
        begin(sphere.work_root, sphere.name, shards)
        assert len(replace(begun).shards) == 100
    # A shard of an earlier number was left.
    begin(sphere.work_root, sphere.name, [(3, 4), *shard_bounds(642, 7)])
    assert len(replace(begun).shards) == 7


@pytest.mark.slow
def test_a_clusters_dataset_keeps_its_shards_on_any_machine(tmp_path):
    folder = checkout(tmp_path)
    # This needs all renders, but no reprojections.
    target = "results/garden/LFSphere_e100cm_d170cm/report/rig.svg"
    arguments = (target, "--config", "rigs=LFSphere_e100cm_d170cm", "preset=full")
    cluster = ("--executor", "cluster-generic", "--cluster-generic-submit-cmd", "sh")
    # With one core each, most jobs of two hours render one view.
    on_cluster = planned(folder, "--jobs", "100", *cluster, *arguments, "cluster_jobs=100")
    assert on_cluster["render"] == 575
    begin(folder / "work", "garden/LFSphere_e100cm_d170cm", shard_bounds(642, 300)[:100])
    assert planned(folder, *arguments)["render"] == 300


def test_a_plan_for_a_cluster_lists_what_jobs_request(tmp_path):
    folder = checkout(tmp_path)
    (folder / "profiles/slurm/config.yaml").write_text(
        (folder / "profiles/slurm/config.yaml")
        .read_text()
        .replace("default-resources:\n", "default-resources:\n  slurm_partition: long\n")
    )
    arguments = (
        "--config",
        "preset=full",
        "scenes=[garden]",
        "rigs=LFCuboid_8panos",
        "device=optix",
    )
    more = ("--set-resources", "render:mem_mb=9000", "--cores", "2", "--dry-run")
    plan = snakemake(folder, "--profile", "profiles/slurm", *more, *arguments)
    assert plan.returncode == 0, plan.stderr
    rows = dict(line.split(maxsplit=1) for line in plan.stdout.splitlines() if line)
    assert rows["rule"].split() == ["jobs", "CPUs", "mem_mb", "runtime", "slurm_partition", "gpu"]
    # A GPU renders two of the eight panoramas in more than five minutes.
    jobs, cpus, memory, _, *others = rows["render"].split()
    assert (jobs, cpus, memory, others) == ("4", "2", "9,000", ["long", "1"])
    assert rows["validate"].split() == ["1", "2", "4,000", "120", "long", "–"]
    # It runs on the login node.
    assert "lightfield" not in rows
    # No job requests more than the partition allows.
    plan = snakemake(
        folder, "--profile", "profiles/slurm", *more, *arguments, "partition_minutes=40"
    )
    rows = [line.split() for line in plan.stdout.splitlines()]
    limits = {row[0]: int(row[4]) for row in rows if row and row[0] in ("render", "validate")}
    assert set(limits) == {"render", "validate"} and max(limits.values()) <= 40
    # No GPU was measured.
    assert "GPU: taken as 64 cores" in plan.stdout and "not measured" in plan.stdout
    # This machine's own jobs are not submitted.
    here = snakemake(folder, "--dry-run", *arguments)
    assert "slurm_partition" not in here.stdout and "phase" in here.stdout
    assert "64 cores" not in here.stdout


def test_a_partition_that_ends_jobs_before_their_first_view_is_a_warning(tmp_path):
    """A view takes 8.4 MP × 256 samples × 6 µs: 3 h 35 min of a core, or half of it on two."""
    folder = checkout(tmp_path)
    keys = ("--config", "preset=full", "scenes=[garden]", "rigs=LFCuboid_8panos")

    def warnings(cores, *more):
        options = ("-n", "--profile", "profiles/slurm", "--cores", cores)
        plan = snakemake(folder, *options, *keys, *more)
        assert plan.returncode == 0, plan.stderr
        return [line for line in plan.stderr.splitlines() if "partition_minutes" in line]

    (warning,) = warnings("2", "partition_minutes=40")
    assert warning.startswith("warning: garden/LFCuboid_8panos: one view is expected to take ")
    assert "1 h 47 min" in warning and " 40 min" in warning
    least_cores = re.search(r"--cores (\d+)", warning)[1]
    assert warnings(str(int(least_cores) - 1), "partition_minutes=40")
    assert not warnings(least_cores, "partition_minutes=40")
    assert not warnings("2")
    # A GPU is expected to be as fast as 64 cores.
    assert not warnings("2", "partition_minutes=40", "device=optix")


CLIPPED = """
licence: CC0-1.0
scene: {builder: room}
render: {samples: 4}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    size: 0.5
    camera: {lens: equidistant, fov: 180, resolution: [24, 24]}
reprojections:
  sphere: {camera: &camera {lens: double_sphere, focal_length: 6, resolution: [96, 96],
    coefficients: [-0.172, 0.593]}, format: png}
  chosen: {camera: {<<: *camera, fov: 252}, format: png}
"""


def test_a_lens_that_ends_inside_its_image_is_a_warning_that_names_fov(tmp_path):
    folder = checkout(tmp_path, clipped=CLIPPED)
    plan = snakemake(folder, "-n", "--config", "scenes=[clipped]", "preset=full", "rigs=all")
    assert plan.returncode == 0, plan.stderr
    (warning,) = (line for line in plan.stderr.splitlines() if line.startswith("warning"))
    assert warning.startswith("warning: clipped/LFPlane/sphere: the double-sphere fisheye ends at ")
    # The limit of the double sphere, and the area outside a circle of this radius.
    angle, radius, share = map(float, re.findall(r"([\d.]+)(?:°| focal| %)", warning))
    assert abs(angle - 126.15) < 0.1
    assert abs(radius - 2.319) < 0.001
    assert abs(share - 100 * (1 - math.pi * (radius * 6 / 36) ** 2)) < 1
    assert warning.endswith("choose a smaller limit by fov")


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        (
            "{lens: stereographic, fov: 359, resolution: [2048, 2048]}",
            ["stereographic fisheye, 359°", "0.62 pixels"],
        ),
        (
            "{lens: brown_conrady, focal_length: 15, coefficients: [-0.3, 0, 0.002, -0.001],"
            " resolution: [752, 480]}",
            ["Brown–Conrady lens"],
        ),
    ],
    ids=["steep", "folds"],
)
def test_a_lens_that_would_err_visibly_is_refused_before_the_first_job(tmp_path, camera, said):
    scene = CLIPPED.replace("{lens: equidistant, fov: 180, resolution: [24, 24]}", camera)
    folder = checkout(tmp_path, clipped=scene)
    arguments = ("--config", "scenes=[clipped]", "preset=full", "rigs=all")
    run = snakemake(folder, "--cores", "1", *arguments)
    assert run.returncode
    (error,) = (line for line in run.stderr.splitlines() if line.startswith("error: "))
    assert error.startswith("error: clipped/LFPlane: camera: ")
    for words in (*said, "smaller fov"):
        assert words in error
    assert not list(folder.rglob("*.blend"))


def phases(folder, *arguments):
    """Return the number of jobs of each phase in a plan of the smoke scene."""
    plan = snakemake(folder, "-n", *arguments, "scenes=[smoke]", "preset=full")
    assert plan.returncode == 0, plan.stderr
    table = plan.stdout[plan.stdout.index("phase ") :].split("\n\n")[0]
    return {phase: int(jobs) for phase, jobs, *_ in map(str.split, table.splitlines()[1:])}


def test_a_plan_until_a_rule_counts_only_the_jobs_until_then(tmp_path):
    folder = checkout(tmp_path / "plenoforge")
    everything = phases(folder, "--config")
    for rule, last in {"inventory": "scene", "render": "views", "reproject": "sensor"}.items():
        counted = phases(folder, "--until", rule, "--config")
        assert [*counted][-2:] == [last, "all"]
        assert counted["all"] == sum(counted.values()) / 2 < everything["all"]
    assert counted["views"] == everything["views"]


def test_a_plan_with_a_storage_counts_all_jobs_and_lists_what_they_request(tmp_path):
    everything = phases(checkout(tmp_path / "shared"), "--config")
    store = tmp_path / "store"
    options = ["--default-storage-provider", "fs", "--default-storage-prefix", str(store)]
    options += ["--shared-fs-usage", "source-cache", "persistence"]
    keys = ("--config", f"storage={store}", "cluster_jobs=10", "scenes=[smoke]", "preset=full")
    plan = snakemake(checkout(tmp_path / "stored"), "-n", *options, *keys)
    assert plan.returncode == 0, plan.stderr
    rows = dict(line.split(maxsplit=1) for line in plan.stdout.splitlines() if line)
    assert int(rows["all"].split()[0]) == everything["all"]
    assert rows["validate"].split() == ["3", "1", "4,000", "120", "–", "–"]


def test_ranges_of_requests_have_the_least_and_the_largest():
    requests = [
        Request("render", 16, {"mem_mb": memory, "runtime": 30, "gpu": 0})
        for memory in (8000, 4000, 6000)
    ]
    row = requests_table(requests).splitlines()[1]
    assert row.split("  ", 1)[1].split() == ["3", "16", "4,000", "to", "8,000", "30", "–", "–"]


ENERGY = Energy(watts=100, cores=4)


def test_the_table_adds_up_the_probes_measurements():
    fisheye = ProbedViews(100, (2048, 2048), 256, "CPU", (30.0, 36.0, 42.0), (1e7, 1.2e7), False)
    panoramas = ProbedViews(8, (4096, 2048), 256, "CPU", (90.0,), (1e7, 1.2e7))
    datasets = [("garden/LFSphere", 3, fisheye), ("garden/LFCuboid_8panos", 1, panoramas)]
    text = plan.table(datasets, {}, ENERGY, {})
    # 300 views of 36 ± 12/√12 s take 3 h, and of 11 MB 3.3 GB.
    assert (
        "| garden/LFSphere | 300 | 2048 × 2048 | 256 | 36 ± 3 | 3 h 00 min | 3 h 00 min "
        "| — | — | — | 3.3 GB |" in text
    )
    assert (
        "| garden/LFCuboid_8panos | 8 | 4096 × 2048 | 256 | 90 ± 0 | 12 min | — | — | — | — "
        "| 88 MB |" in text
    )
    assert "| all | 308 | | | | 3 h 12 min ± 17 min | — | — | | | 3.39 GB |" in text
    assert "Times of one processor core" in text
    assert "time = views × s a view" in text.split("| all |")[1]
    # A quarter of 100 W for 300 × 36 s and 8 × 90 s.
    assert "and 0.08 kWh." in text
    on_card = replace(fisheye, device="GPU")
    # The whole machine takes 100 W for 100 × 36 s.
    text = plan.table([("a/b", 1, on_card)], {}, ENERGY, {})
    assert "Times of the graphics card, with 0.1 kWh together." in text


def test_times_of_a_core_and_of_a_graphics_card_have_no_sum():
    on_core = ProbedViews(10, (64, 64), 4, "CPU", (60.0,), (1e6,))
    on_card = replace(on_core, device="GPU", seconds=(0.5,))
    text = plan.table([("a/b", 1, on_core), ("a/c", 1, on_card)], {}, ENERGY, {})
    assert "| 60 ± 0 | 10 min |" in text and "| 0.5 ± 0 | 5 s |" in text
    assert "| all | 20 | | | | — | — | — | | | 20 MB |" in text
    assert "graphics card for a/c, and of one processor core for the others" in text


def error_vs_time(denoised_error=lambda n: 0.5 / n, seconds=lambda n: float(n)):
    """Return a measurement: path tracing has the error 1 / N, and denoising costs three samples."""
    counts = (4, 8, 16)
    return {
        "changes": {
            "own": {"samples": 256, "denoise": False},
            "unchanged": {
                "path tracing": [
                    {"samples": n, "seconds": seconds(n), "error": 1 / n} for n in counts
                ],
                "denoised": [
                    {"samples": n, "seconds": seconds(n + 3), "error": denoised_error(n)}
                    for n in counts
                ],
            },
        },
        "points": [
            {
                "method": "denoised",
                "settings": {"samples": n},
                "samples": n,
                "bias": 0.3 / n,
                "relative_mse_whole": 0.5 / n if n == 128 else 9,
            }
            for n in (1, 128, 256)
        ],
        "neighbouring_views": [
            {"method": "denoised", "settings": {"samples": 128}, "bias_correlation": 0.75}
        ],
    }


HUNDRED_HOURS = ProbedViews(100, (64, 64), 256, "CPU", (3600.0,), (1e9,), False)


def test_the_time_at_equal_error_is_beside_the_plain_one():
    choices = of_measurement(HUNDRED_HOURS, error_vs_time())
    assert choices.cheapest == pytest.approx((128 + 3) / 256)
    # The nearest point of those that were measured has 128 samples.
    assert (choices.bias, choices.correlation) == (pytest.approx(0.6), 0.75)
    text = plan.table([("a/b", 1, HUNDRED_HOURS)], {"a/b": choices}, ENERGY, {})
    assert "| 100 h | 100 h | 51 h | 60% | 0.75 | 100 GB |" in text
    assert "target_error: {of_samples: 256}" in text and "error_vs_time" not in text


@pytest.mark.parametrize(
    "content",
    [
        None,
        # A denoiser's error that hardly falls never reaches that of plain path tracing.
        error_vs_time(denoised_error=lambda n: 0.1 * n**-0.001),
        # Without noise, or without a time, no estimate is possible.
        error_vs_time(denoised_error=lambda n: 0.0),
        error_vs_time(seconds=lambda n: 0.0),
        error_vs_time() | {"changes": {"own": {"samples": 6, "denoise": False}}},
    ],
)
def test_a_plan_says_how_to_learn_the_time_at_equal_error(content):
    choices = of_measurement(HUNDRED_HOURS, content)
    text = plan.table([("a/b", 1, HUNDRED_HOURS)], {"a/b": choices}, ENERGY, {})
    assert "| 100 h | 100 h | — | — | — | 100 GB |" in text
    assert "`snakemake --cores 2 error_vs_time`" in text
    assert "target_error: {of_samples: 256}" in text


def test_the_times_of_a_calibrated_scene_are_those_of_its_calibration(tmp_path):
    """Its own settings are the choice."""
    record, seconds = tmp_path / "calibration.json", tmp_path / "calibration_seconds.json"
    bias = {"squared_bias": 0.002, "error": 0.008, "correlation": None}
    record.write_text(json.dumps({"choice": {}, "bias": bias}))
    seconds.write_text(json.dumps({"times_faster": 4.0}))
    probe = replace(HUNDRED_HOURS, denoise=True)
    files = tmp_path / "probe.json", tmp_path / "plan.md"
    content = {"views": 100, "resolution": [64, 64], "samples": 256, "device": "CPU"}
    content |= {"view_seconds": [3600.0], "view_bytes": [1e9], "denoise": True}
    files[0].write_text(json.dumps(content))
    assert read_probe(files[0]) == probe

    def table():
        calibration = [("a/b", record, seconds)]
        Plan(dataset=[("a/b", 1, files[0])], calibration=calibration, output=files[1]).run()
        return files[1].read_text()

    assert "| 100 h | 400 h | 100 h | 25% | — | 100 GB |" in table()
    assert "target_error" not in table()
    # An older calibration has no bias, and its seconds may be lost.
    record.write_text(json.dumps({"choice": {}}))
    seconds.unlink()
    assert "| 100 h | — | 100 h | — | — | 100 GB |" in table()


def test_a_probe_estimates_the_size_of_the_views(run_program, room, tmp_path):
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [128, 128]})
    rig = {"type": "sphere", "subdivisions": 1, "center": [0, 0, 1.5]}
    render = {"samples": 4, "adaptive_threshold": 0, "denoise": False, "seed": 0}
    render |= {"depth_precision": "float"}
    lightfield, inventory = tmp_path / "lightfield.json", tmp_path / "inventory.json"
    LightField.from_rig(rig, lens, depth="z", frame=1, render=render).write(lightfield)
    run_program("inventory.py", "--blend", room, "--output", inventory)
    shared = ("--blend", room, "--inventory", inventory, "--lightfield", lightfield)
    run_program("probe.py", *shared, "--size", "64", "--output", tmp_path / "probe.json")
    probe = json.loads((tmp_path / "probe.json").read_text())
    assert (probe["views"], probe["resolution"], probe["samples"]) == (12, [128, 128], 4)
    assert len(probe["view_seconds"]) == len(probe["view_bytes"]) == 3
    assert min(probe["view_seconds"]) > 0
    run_program("render_shard.py", *shared, "--output", tmp_path / "exr", "--threads", "1")
    sizes = [path.stat().st_size for path in (tmp_path / "exr").glob("*.exr")]
    foretold = sum(probe["view_bytes"]) / 3
    # This is an upper estimate: small views compress worse.
    assert 1 <= foretold / (sum(sizes) / 12) < 1.4
    # It follows the requested size.
    other = render | {"depth_precision": "half"}
    LightField.from_rig(rig, lens, depth="z", frame=1, render=other).write(lightfield)
    run_program("probe.py", *shared, "--size", "64", "--output", tmp_path / "probe.json")
    smaller = json.loads((tmp_path / "probe.json").read_text())
    assert sum(smaller["view_bytes"]) / 3 < 0.9 * foretold


def test_a_rig_of_one_view_is_probed_with_it(tmp_path, monkeypatch):
    def render(job):
        job.output.mkdir()
        History()
        shard_log.log({"start_up_seconds": 1.0, "device": "CPU", "threads": 1})
        for view in LightField.read(job.lightfield).views:
            (job.output / f"{view.name}.exr").write_bytes(b"1000")
            seconds = dict.fromkeys(("wall_seconds", "cpu_seconds", "render_seconds"), 2.0)
            shard_log.log({"view": view.name, "finished": 3.0, **seconds})

    monkeypatch.setattr(shard, "render", render)
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [128, 128]})
    path = tmp_path / "lightfield.json"
    LightField.from_rig({"type": "plane", "cameras": [1, 1]}, lens, render={"samples": 4}).write(
        path
    )
    output = tmp_path / "probe.json"
    Probe(
        settings=ProbeSettings(size=64),
        blend=tmp_path,
        inventory=tmp_path,
        lightfield=path,
        output=output,
    ).run()
    expected = read_probe(output)
    assert (expected.seconds, expected.sizes) == ((8.0,), (16.0,))
    text = plan.table([("a/b", 1, expected)], {}, ENERGY, {})
    assert "| a/b | 1 | 128 × 128 | 4 | 8 ± 0 |" in text
