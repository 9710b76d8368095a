"""LPIPS with given weights, compared with the same network made of other libraries' functions."""

import csv

import numpy as np
import pytest
from scipy.signal import correlate
from skimage.util import view_as_windows
from sphere import write_views

from lightfield.core.errors import UserError
from lightfield.measurement import lpips

# The convolutions of the packages torchvision and lpips: the slice and the number of each, its
# filters, channels, width, padding and stride. A number in front of them is the width of a pool.
ALEX = [
    ("slice1.0", 64, 3, 11, 2, 4),
    3,
    ("slice2.3", 192, 64, 5, 2, 1),
    3,
    ("slice3.6", 384, 192, 3, 1, 1),
    ("slice4.8", 256, 384, 3, 1, 1),
    ("slice5.10", 256, 256, 3, 1, 1),
]
VGG = [
    ("slice1.0", 64, 3, 3, 1, 1),
    ("slice1.2", 64, 64, 3, 1, 1),
    2,
    ("slice2.5", 128, 64, 3, 1, 1),
    ("slice2.7", 128, 128, 3, 1, 1),
    2,
    ("slice3.10", 256, 128, 3, 1, 1),
    ("slice3.12", 256, 256, 3, 1, 1),
    ("slice3.14", 256, 256, 3, 1, 1),
    2,
    ("slice4.17", 512, 256, 3, 1, 1),
    ("slice4.19", 512, 512, 3, 1, 1),
    ("slice4.21", 512, 512, 3, 1, 1),
    2,
    ("slice5.24", 512, 512, 3, 1, 1),
    ("slice5.26", 512, 512, 3, 1, 1),
    ("slice5.28", 512, 512, 3, 1, 1),
]
NETS = {"alex": ALEX, "vgg": VGG}


def state_dict(net):
    """Return random weights as the package lpips has them: with its scale, and with lins twice."""
    rng = np.random.default_rng(7)
    weights = {
        "scaling_layer.shift": np.reshape([-0.030, -0.088, -0.188], (1, 3, 1, 1)),
        "scaling_layer.scale": np.reshape([0.458, 0.448, 0.450], (1, 3, 1, 1)),
    }
    for layer in NETS[net]:
        if isinstance(layer, int):
            continue
        name, filters, channels, width, *_ = layer
        spread = (2 / (channels * width**2)) ** 0.5
        shape = (filters, channels, width, width)
        weights[f"net.{name}.weight"] = spread * rng.standard_normal(shape, np.float32)
        weights[f"net.{name}.bias"] = 0.1 * rng.standard_normal(filters, np.float32)
        # The last convolution of a slice remains.
        number = int(name[5]) - 1
        weights[f"lin{number}.model.1.weight"] = rng.random((1, filters, 1, 1), np.float32)
        weights[f"lins.{number}.model.1.weight"] = weights[f"lin{number}.model.1.weight"]
    return {key: value.astype(np.float32) for key, value in weights.items()}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return a file of weights for each network."""
    folder = tmp_path_factory.mktemp("weights")
    for net in NETS:
        np.savez(folder / f"{net}.npz", **state_dict(net))
    return {net: folder / f"{net}.npz" for net in NETS}


def features(net, weights, picture):
    """Return the features of a picture at the end of each slice, in float64."""
    shift, scale = ([-0.030, -0.088, -0.188], [0.458, 0.448, 0.450])
    values = np.moveaxis((2 * picture - 1 - shift) / scale, -1, 0)
    ends = {}
    for layer in NETS[net]:
        if isinstance(layer, int):
            windows = view_as_windows(values, (1, layer, layer), (1, 2, 2))
            values = windows.max(axis=(-3, -2, -1))
            continue
        name, _, _, _, padding, stride = layer
        padded = np.pad(values, ((0, 0), (padding,) * 2, (padding,) * 2))
        values = np.stack(
            [
                bias + correlate(padded, kernel, mode="valid", method="direct")[0]
                for kernel, bias in zip(
                    weights[f"net.{name}.weight"].astype(float),
                    weights[f"net.{name}.bias"].astype(float),
                    strict=True,
                )
            ]
        )[:, ::stride, ::stride].clip(0)
        ends[name[:6]] = values
    return list(ends.values())


def expected(net, picture, other):
    """Return the LPIPS of two pictures, as the paper defines it."""
    weights = state_dict(net)
    pairs = zip(features(net, weights, picture), features(net, weights, other), strict=True)
    total = 0.0
    for number, pair in enumerate(pairs):
        units = [values / (np.linalg.norm(values, axis=0) + 1e-10) for values in pair]
        factors = weights[f"lin{number}.model.1.weight"].astype(float)[0]
        total += (factors * (units[0] - units[1]) ** 2).sum(axis=0).mean()
    return total


@pytest.mark.parametrize(("net", "size"), [("alex", (33, 45)), ("vgg", (17, 21))])
def test_lpips_is_the_distance_in_the_networks_features(files, net, size):
    rng = np.random.default_rng(5)
    picture = rng.random((*size, 3))
    other = (picture + rng.normal(0, 0.1, picture.shape)).clip(0, 1)
    network = lpips.read(files[net])
    assert network.net == net
    distance = network.distance(picture, other)
    assert distance == pytest.approx(expected(net, picture, other), abs=1e-6)
    assert distance > 0.001
    assert network.distance(other, picture) == pytest.approx(distance, abs=1e-9)
    assert network.distance(picture, picture) == 0


def test_rows_are_convolved_in_strips(files, monkeypatch):
    """A large picture has the same distance as if it were convolved at once."""
    rng = np.random.default_rng(5)
    pictures = rng.random((2, 70, 50, 3))
    network = lpips.read(files["alex"])
    whole = network.distance(*pictures)
    monkeypatch.setattr(lpips, "_MOST_VALUES", 5000)
    assert network.distance(*pictures) == pytest.approx(whole, abs=1e-7)


def test_other_weights_are_named(files, tmp_path):
    path = tmp_path / "weights.npz"
    weights = state_dict("alex")
    for spoilt in (
        {key: value for key, value in weights.items() if key != "net.slice3.6.bias"},
        weights | {"lin4.model.1.weight": np.ones((1, 255, 1, 1), np.float32)},
        weights | {"net.slice1.0.weight": np.ones((64, 3, 11, 11), np.complex64)},
        weights | {"net.slice1.0.bias": np.array([None] * 64)},
    ):
        np.savez(path, **spoilt)
        with pytest.raises(UserError, match=rf"^{path}: .*numpy\.savez\('lpips_alex\.npz'"):
            lpips.read(path)
    for content in (b"", b"PK\x03\x04", b"not an archive", files["alex"].read_bytes()[:100_000]):
        path.write_bytes(content)
        with pytest.raises(UserError, match=rf"^{path}: is not an NPZ file of arrays; make it by"):
            lpips.read(path)
    with pytest.raises(UserError, match=rf"^{tmp_path}/none.npz: "):
        lpips.read(tmp_path / "none.npz")


def test_views_too_small_for_the_network_are_named(files):
    with pytest.raises(UserError, match=r"the views are 40 × 30 pixels; .* 31 × 31"):
        lpips.read(files["alex"]).distance(*np.ones((2, 30, 40, 3)))
    assert lpips.read(files["alex"]).distance(*np.ones((2, 31, 31, 3))) == 0
    assert lpips.read(files["vgg"]).distance(*np.ones((2, 16, 16, 3))) == 0


def test_evaluate_says_lpips_and_its_network(files, tmp_path, run_program):
    camera = {"lens": "rectilinear", "fov": 70, "resolution": [40, 32]}
    rig = {"type": "plane", "cameras": [2, 1], "size": 0.4, "split": "odd"}
    write_views(tmp_path / "dataset", camera, rig)
    arguments = [tmp_path / "dataset/exr", "--dataset", tmp_path / "dataset", "--output"]
    without = run_program("evaluate.py", *arguments, tmp_path / "without").stdout
    assert "--lpips-weights" in without
    assert "numpy.savez" in (tmp_path / "without/index.html").read_text()
    weights = ["--lpips-weights", files["alex"]]
    shown = run_program("evaluate.py", *arguments, tmp_path / "page", *weights).stdout
    assert "LPIPS (alex) 0.0000" in shown
    with (tmp_path / "page/evaluation.csv").open() as file:
        rows = {row["region"]: row["lpips"] for row in csv.DictReader(file)}
    assert rows == {"all": "0.0", "centre": "", "rim": ""}
    assert "LPIPS (alex)" in (tmp_path / "page/index.html").read_text()
