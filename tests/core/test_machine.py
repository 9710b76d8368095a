"""Properties of a machine that change bytes: lightfield.json and each view's header name them."""

import ctypes
import subprocess
import sys

import pytest

from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.config_file import Preset
from lightfield.core import machine
from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.planning.loading import scene_datasets

LIBRARY = ctypes.CDLL(None).gnu_get_libc_version
LIBRARY.restype = ctypes.c_char_p
CPUINFO = (
    "processor\t: 0\nvendor_id\t: {}\nflags\t\t: fpu sse4_2 {}\n\nprocessor\t: 1\nflags\t: none\n"
)
# All that Cycles requires of a processor for its fast kernels.
FAST = "avx f16c avx2 fma bmi1 bmi2"
FASTEST = FAST + " avx512f avx512dq avx512cd avx512bw avx512vl"


@pytest.mark.parametrize(
    ("maker", "flags", "denoise", "described"),
    [
        ("GenuineIntel", FAST, False, "GenuineIntel AVX2"),
        ("GenuineIntel", FAST, True, "GenuineIntel AVX2"),
        ("AuthenticAMD", FASTEST, False, "AuthenticAMD AVX2"),
        # Only the denoiser uses these.
        ("AuthenticAMD", FASTEST, True, "AuthenticAMD AVX-512"),
        ("AuthenticAMD", FAST.replace("fma ", ""), True, "AuthenticAMD SSE4.2"),
    ],
)
def test_a_machine_is_described_by_processor_maker_instructions_and_c_library(
    maker, flags, denoise, described, tmp_path
):
    file = tmp_path / "cpuinfo"
    file.write_text(CPUINFO.format(maker, flags))
    assert machine.describe(denoise, file) == f"{described}, glibc {LIBRARY().decode()}"


@pytest.mark.parametrize(
    ("flags", "has"), [(FAST, True), (FASTEST, True), (FAST.replace("fma ", ""), False)]
)
def test_a_processor_with_avx2_has_all_that_comes_with_it(flags, has, tmp_path):
    file = tmp_path / "cpuinfo"
    file.write_text(CPUINFO.format("AuthenticAMD", flags))
    assert machine.has_avx2(file) == has
    assert not machine.has_avx2(tmp_path / "missing")


def test_an_unknown_processor_has_the_name_of_its_kind(tmp_path):
    described = machine.describe(False, tmp_path / "missing")
    assert described == f"x86_64, glibc {LIBRARY().decode()}"


ASK_CYCLES = "import bpy, _cycles; print(_cycles.system_info())"


@pytest.mark.slow
def test_lightfield_and_views_name_the_machine_with_cycles_own_instructions(
    run_program, room, tmp_path
):
    written = tmp_path / "lightfield.json"
    (dataset, *_) = scene_datasets("smoke", limits=Preset(resolution=16, samples=1))
    settings = tmp_path / "settings.json"
    write_json(settings, LightfieldSettings.of_capture(dataset).as_json())
    run_program("make_lightfield.py", "--settings", settings, "--output", written)
    arguments = ("--blend", room, "--lightfield", written, "--views", "0:1", "--device", "cpu")
    run_program("render_shard.py", *arguments, "--output", tmp_path / "exr")
    (view,) = (tmp_path / "exr").iterdir()
    described = LightField.read(written).content["machine"]
    assert images.attribute(view, "plenoforge:machine") == described

    asked = [sys.executable, "-c", ASK_CYCLES]
    output = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    (capabilities,) = (line for line in output.splitlines() if "capabilities" in line)
    assert ("AVX2" in capabilities) == ("AVX2" in described)
