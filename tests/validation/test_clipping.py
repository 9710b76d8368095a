"""Pictures that lose light beyond white: the warning, and the exposure that it names."""

import re

import numpy as np
import pytest
from pydantic import TypeAdapter
from sphere import LENSES, look, write_views

from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.products import exports
from lightfield.validation.validate import validate

RIG = {"type": "plane", "cameras": [3, 3], "size": [0.4, 0, 0.4]}
WARNING = re.compile(
    r"(.+?): ([\d.]+)% of (.*) are brighter than white; exposure: (-?[\d.]+) clips at most 1%"
)


def brighter(factor):
    """Return a function that sees the sphere in brighter light, except its darker half."""

    def see(lens, matrix):
        colour, distance = look(lens, matrix)
        is_bright = colour.max(axis=-1, keepdims=True) > 0.5
        return np.where(is_bright, factor * colour, 0.5 * colour), distance

    return see


def exported(dataset, name, **options):
    """Export the rendered views. Return the part of the pixels that are white in a channel."""
    settings = TypeAdapter(EXPORTERS[name]).validate_python({"sources": ["views"], **options})
    development = {key: value for key, value in options.items() if key in ("exposure", "reinhard")}
    folder = dataset / "exports" / name
    exports.run(SourceDataset(dataset, "", ".exr", **development), settings, folder)
    pictures = [images.read_image(path).srgb for path in sorted(folder.rglob("*.png"))]
    return np.mean([(picture == 255).any(axis=-1) for picture in pictures])


def warnings(dataset, reprojections=()):
    return [
        WARNING.fullmatch(warning).groups()
        for check in validate(dataset, reprojections).checks
        if check.name == "clipping"
        for warning in check.warnings
    ]


@pytest.fixture
def dataset(tmp_path):
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=brighter(3.0))
    return folder


@pytest.mark.parametrize("options", [{}, {"exposure": 1.5}, {"exposure": 0.5, "reinhard": 2.0}])
def test_the_warning_names_the_part_that_is_lost_and_an_exposure_that_keeps_it(dataset, options):
    white = exported(dataset, "hci", **options)
    assert white > 0.05
    ((place, part, _, exposure),) = warnings(dataset)
    assert place == "exports/hci"
    assert float(part) / 100 == pytest.approx(white, abs=0.02)
    exported(dataset, "nerf_synthetic", **options)
    assert [place for place, *_ in warnings(dataset)] == ["exports/hci, nerf_synthetic"]
    for name in ("hci", "nerf_synthetic"):
        assert exported(dataset, name, **options | {"exposure": float(exposure)}) <= 0.01
    assert warnings(dataset) == []


def test_a_lamp_and_a_white_wall_are_not_lost(tmp_path):
    def lamp(lens, matrix):
        colour, distance = brighter(1.0)(lens, matrix)
        colour[:6, :4] = 1000
        colour[20:] = 1
        return colour, distance

    write_views(tmp_path / "dataset", LENSES["perspective"], RIG, see=lamp)
    assert exported(tmp_path / "dataset", "hci") > 0.5
    assert warnings(tmp_path / "dataset") == []


def test_only_what_a_model_covers_counts(tmp_path):
    def model(lens, matrix):
        colour, distance = look(lens, matrix)
        colour[10:] = 0  # in front of nothing
        colour[:2] = 2.0
        return colour, distance

    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=model)
    path = folder / "lightfield.json"
    LightField.read(path).changed(render={"samples": 1, "transparent": True}).write(path)
    for view in folder.glob("exr/*.exr"):
        image = images.read_image(view)
        alpha = np.zeros(image.colour.shape[:2], np.float16)
        alpha[:10] = 1
        channels = {name: image.channels[name] for name in "RGBZ"} | {"A": alpha}
        images.write_exr(view, channels, image.attributes)
    exported(folder, "nerfstudio", points=9)
    ((place, part, *_),) = warnings(folder)
    assert (place, float(part)) == ("exports/nerfstudio", pytest.approx(20))


def test_png_reprojections_are_measured_by_the_rendered_views(dataset):
    folder = dataset / "perspective"
    write_views(folder, LENSES["perspective"], RIG, suffix=".png", see=brighter(3.0))
    path = folder / "lightfield.json"
    LightField.read(path).changed(reprojection={"exposure": 0.0, "reinhard": 1.0}).write(path)
    white = np.mean(
        [(images.read_image(view).srgb == 255).any(axis=-1) for view in folder.glob("*.png")]
    )
    ((place, part, pixels, _),) = warnings(dataset, ["perspective"])
    assert (place, pixels) == ("perspective", "the rendered views' pixels")
    assert float(part) / 100 == pytest.approx(white, abs=0.02)
    LightField.read(path).changed(reprojection={"exposure": -2.0, "reinhard": 1.0}).write(path)
    assert warnings(dataset, ["perspective"]) == []
