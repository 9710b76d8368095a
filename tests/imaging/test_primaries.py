"""The colour space of EXR files: what their headers say is what their pixels are."""

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from lightfield.configuration.reprojections import ReprojectionEntry
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.imaging.primaries import ACESCG, REC_709, conversion, from_rec_709, xyz_matrix
from lightfield.imaging.tonemap import encode_srgb

# Linear Rec. 709, one column of the image each: red, green, blue, white, skin, sky.
PATCHES = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [0.55, 0.3, 0.22], [0.11, 0.2, 0.34]], np.float32
)
# CIE XYZ of linear sRGB's red, green, blue and white. Source: Lindbloom, RGB/XYZ matrices.
XYZ_OF_SRGB = np.array(
    [
        [0.4124564, 0.2126729, 0.0193339],
        [0.3575761, 0.7151522, 0.1191920],
        [0.1804375, 0.0721750, 0.9503041],
        [0.95047, 1.0, 1.08883],
    ]
)
# From ACEScg to XYZ, and from the white point D60 to D65. Source: the Academy's CTL code
# (ACESlib.Utilities_Color.ctl, AP1_2_XYZ_MAT and D60_2_D65_CAT).
AP1_TO_XYZ = np.array(
    [
        [0.6624541811, 0.1340042065, 0.1561876870],
        [0.2722287168, 0.6740817658, 0.0536895174],
        [-0.0055746495, 0.0040607335, 1.0103391003],
    ]
)
D60_TO_D65 = np.array(
    [
        [0.98722400, -0.00611327, 0.01595330],
        [-0.00759836, 1.00186000, 0.00533002],
        [0.00307257, -0.00509595, 1.08168000],
    ]
)
CAMERA = {"lens": "rectilinear", "fov": 60, "resolution": [6, 4]}
# Half floats have 11 binary digits.
HALF = 2**-11


@pytest.fixture
def reproject(tmp_path, reproject_dataset):
    """Return a function that reprojects a view of patches. It returns the new image's path."""
    rig = {"type": "lattice", "cameras": [1, 1, 1], "size": 0}
    content = LightField.from_rig(rig, lenses.from_camera(CAMERA), depth=None, frame=1, render={})
    content.write(tmp_path / "lightfield.json")
    colour = np.broadcast_to(PATCHES, (4, 6, 3)).astype(np.float16)
    source = tmp_path / "exr" / "view_0000f.exr"
    images.write_exr(source, dict(zip("RGB", np.moveaxis(colour, -1, 0), strict=True)))

    def run(name, **settings):
        reprojection = ReprojectionEntry.model_validate(settings).resolved(None)
        reproject_dataset(tmp_path, tmp_path / name, reprojection.as_json())
        return tmp_path / name / f"view_0000f{reprojection.suffix}"

    return run


def header_by_openexr(path):
    return OpenEXR.File(str(path), header_only=True).header().get("chromaticities")


def header_by_openimageio(path):
    file = oiio.ImageInput.open(str(path))
    value = file.spec().getattribute("chromaticities")
    file.close()
    return value


def pixels_by_openimageio(path):
    buffer = oiio.ImageBuf(str(path))
    return np.asarray(buffer.get_pixels(oiio.FLOAT))[0]


@pytest.mark.parametrize(
    ("primaries", "expected"), [("rec709", REC_709), ("acescg", ACESCG), (None, None)]
)
def test_an_exr_names_its_primaries_if_asked_to(reproject, primaries, expected):
    settings = {"primaries": primaries} if primaries else {}
    path = reproject("hdr", format="exr", **settings)
    for read in (header_by_openexr, header_by_openimageio):
        value = read(path)
        assert (value is None) == (expected is None)
        if expected:
            np.testing.assert_allclose(value, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("primaries", ["rec709", "acescg"])
def test_a_patch_has_its_xyz_by_the_files_own_header(reproject, primaries):
    path = reproject("hdr", format="exr", primaries=primaries)
    to_xyz = xyz_matrix(tuple(header_by_openimageio(path)))
    xyz = pixels_by_openimageio(path) @ to_xyz.T
    if primaries == "acescg":
        xyz = xyz @ D60_TO_D65.T
    np.testing.assert_allclose(xyz[:4], XYZ_OF_SRGB, rtol=0, atol=2 * HALF)


def test_matrices_are_those_of_the_standards():
    np.testing.assert_allclose(xyz_matrix(ACESCG), AP1_TO_XYZ, rtol=0, atol=1e-6)
    # Lindbloom's white point has other digits than (0.3127, 0.3290).
    np.testing.assert_allclose(xyz_matrix(REC_709).T, XYZ_OF_SRGB[:3], rtol=0, atol=3e-4)


def test_acescg_is_that_of_opencolorio(reproject):
    source = oiio.ImageBuf(oiio.ImageSpec(6, 1, 3, "float"))
    source.set_pixels(oiio.ROI(0, 6, 0, 1, 0, 1, 0, 3), PATCHES[None])
    converted = oiio.ImageBufAlgo.colorconvert(
        source, "lin_rec709", "ACEScg", colorconfig="ocio://default"
    )
    assert not converted.has_error
    expected = np.asarray(converted.get_pixels(oiio.FLOAT))[0]
    np.testing.assert_allclose(from_rec_709(PATCHES, "acescg"), expected, rtol=0, atol=2e-5)
    path = reproject("hdr", format="exr", primaries="acescg")
    np.testing.assert_allclose(pixels_by_openimageio(path), expected, rtol=0, atol=HALF)


def test_every_reader_sees_rec_709(reproject, tmp_path):
    path = reproject("hdr", format="exr", primaries="acescg")
    np.testing.assert_allclose(images.read_image(path).colour[0], PATCHES, rtol=0, atol=3 * HALF)
    # As another's dataset: its views are in ACEScg.
    path.replace(tmp_path / "exr" / "view_0000f.exr")
    png = images.read_image(reproject("png", bits=16)).channels
    pixels = np.stack([png[name] for name in "RGB"], axis=-1)[0] / 65535
    # The curve of sRGB is steepest at black.
    np.testing.assert_allclose(pixels, encode_srgb(PATCHES), rtol=0, atol=12.92 * 3 * HALF)
    exr = pixels_by_openimageio(reproject("back", format="exr"))
    np.testing.assert_allclose(exr, PATCHES, rtol=0, atol=3 * HALF)


def test_white_stays_white_between_white_points():
    white = conversion(REC_709, ACESCG) @ np.ones(3)
    np.testing.assert_allclose(white, 1, rtol=0, atol=1e-12)


def test_a_file_of_several_parts_has_its_chromaticities(tmp_path):
    path = tmp_path / "parts.exr"
    plane = np.ones((2, 2), np.float32)
    header = {"chromaticities": ACESCG, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part({**header, "name": "colour"}, dict.fromkeys("RGB", plane)),
        OpenEXR.Part({**header, "name": "depth"}, {"Z": plane}),
    ]
    OpenEXR.File(parts).write(str(path))
    np.testing.assert_allclose(images.read_image(path).chromaticities, ACESCG, rtol=0, atol=1e-6)
    np.testing.assert_allclose(images.read_header(path).chromaticities, ACESCG, rtol=0, atol=1e-6)
