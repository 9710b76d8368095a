"""A user's environment, home and folder change no byte of what Python, Blender and numba make."""

import ast
import json
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from checkouts import checkout
from conftest import SCRIPTS

from lightfield.core import isolation
from lightfield.core.files import sha256
from lightfield.core.isolation import cleaned
from lightfield.core.machine import has_avx2
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images

# A lamp over a floor. The picture's colour space exists in Blender's own configuration.
BUILD = """
import sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_plane_add(size=6)
picture = bpy.data.images.new("picture", 8, 8)
picture.pixels = [index % 7 / 7 if index % 4 < 3 else 1 for index in range(256)]
picture.pack()
picture.colorspace_settings.name = "AgX Log"
material = bpy.data.materials.new("floor")
material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
texture = nodes.new("ShaderNodeTexImage")
texture.image = picture
links.new(texture.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
bpy.context.object.data.materials.append(material)
light = bpy.data.lights.new("lamp", "POINT")
light.energy = 100
lamp = bpy.data.objects.new("lamp", light)
lamp.location = (0, 0, 2)
bpy.context.scene.collection.objects.link(lamp)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
"""
# Doubles the lights of each scene that is opened.
BRIGHTEN = """
import bpy

@bpy.app.handlers.persistent
def brighten(*_):
    for light in bpy.data.lights:
        light.energy *= 2

bpy.app.handlers.load_post.append(brighten)

def register():
    pass
"""
RENDER = {"samples": 2, "adaptive_threshold": 0, "denoise": False, "seed": 0}
RIG = {"type": "lattice", "cameras": [1, 1, 1], "center": [0, 0, 1.5], "rotation": [20, -35, 50]}


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def startup_script(folder):
    written(folder / "startup/brighten.py", BRIGHTEN)
    return {"BLENDER_SYSTEM_SCRIPTS": folder}


def sitecustomize(folder):
    written(folder / "sitecustomize.py", BRIGHTEN)
    return {"PYTHONPATH": folder}


def shadowed_numpy(folder):
    written(folder / "numpy.py", "raise SystemExit('another numpy')")
    return {"PYTHONPATH": folder}


def other_colours(folder):
    return {"OCIO": "ocio://default"}


def files_at_home(folder):
    blender = folder / ".config/blender" / ".".join(version("bpy").split(".")[:2])
    written(blender / "datafiles/colormanagement/config.ocio", "no configuration")
    written(blender / "config/userpref.blend", "no preferences")
    written(blender / "scripts/startup/brighten.py", BRIGHTEN)
    written(blender / "scripts/addons/cycles/__init__.py", BRIGHTEN)
    return {"HOME": folder}


def colours_of_a_system(folder):
    written(folder / "colormanagement/config.ocio", "no configuration")
    return {"BLENDER_SYSTEM_DATAFILES": folder}


def other_instructions(folder):
    return {"CYCLES_CPU_NO_AVX2": "1"}


def other_libraries(folder):
    written(folder / "libembree4.so.4", "no library")
    return {"LD_LIBRARY_PATH": folder}


HOSTILE = [
    startup_script,
    sitecustomize,
    shadowed_numpy,
    other_colours,
    files_at_home,
    colours_of_a_system,
    other_instructions,
    other_libraries,
]


@pytest.fixture(scope="module")
def render(tmp_path_factory):
    """Return a function that renders with further variables, and returns the view's SHA-256."""
    folder = tmp_path_factory.mktemp("isolation")
    blend, content = folder / "scene.blend", folder / "lightfield.json"
    subprocess.run([sys.executable, "-c", BUILD, blend], check=True, capture_output=True)
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [32, 32]})
    keys = {"depth": "distance", "frame": 1, "scene": {}, "render": RENDER}
    keys["render"]["depth_precision"] = "float"
    LightField.from_rig(RIG, lens, **keys).write(content)

    def run(name, variables):
        output = folder / name
        result = subprocess.run(
            [
                sys.executable,
                SCRIPTS / "render_shard.py",
                "--blend",
                blend,
                "--lightfield",
                content,
                "--output",
                output,
                "--device",
                "cpu",
            ],
            env=cleaned(os.environ) | {name: str(value) for name, value in variables.items()},
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        (view,) = output.glob("*.exr")
        return sha256(view)

    run.clean = run("clean", {})
    return run


@pytest.mark.slow
@pytest.mark.parametrize("hostile", HOSTILE, ids=lambda hostile: hostile.__name__)
def test_a_view_has_the_same_bytes_in_a_hostile_environment(hostile, render, tmp_path):
    assert render(hostile.__name__, hostile(tmp_path)) == render.clean


@pytest.fixture
def reproject(tmp_path, run_program):
    """Return a function that reprojects with further variables, and returns a SHA-256."""
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [32, 32]})
    LightField.from_rig(RIG, lens, depth="distance").write(tmp_path / "lightfield.json")
    (tmp_path / "exr").mkdir()
    random = np.random.default_rng(0).random((4, 32, 32), np.float32)
    channels = dict(zip("RGB", random[:3].astype(np.float16), strict=True)) | {"Z": random[3] + 1}
    images.write_exr(tmp_path / "exr/view_0000f.exr", channels, {})

    def run(name, **variables):
        output = tmp_path / name
        result = subprocess.run(
            [
                sys.executable,
                SCRIPTS / "reproject.py",
                "--rectilinear",
                "18,36",
                "--exr",
                "--input-dir",
                tmp_path / "exr",
                "--input-cfg",
                tmp_path / "lightfield.json",
                "--output-dir",
                output,
                "--output-cfg",
                output / "lightfield.json",
            ],
            env=cleaned(os.environ) | variables,
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        return [sha256(path) for path in sorted(output.iterdir())]

    return run


@pytest.mark.slow
def test_a_reprojected_view_has_the_same_bytes_without_numbas_compiler(reproject):
    assert reproject("hostile", NUMBA_DISABLE_JIT="1") == reproject("clean")


# Asks the libraries themselves which kernels they use.
KERNELS = """
import lightfield

import ctypes
import json
from pathlib import Path
import numba.core.registry
import numpy
import scipy.linalg

def core(path):
    library = ctypes.CDLL(path)
    names = [f"{a}openblas_get_corename{b}" for a in ("", "scipy_") for b in ("", "64_")]
    (ask,) = (getattr(library, name) for name in names if hasattr(library, name))
    ask.restype = ctypes.c_char_p
    return ask().decode()

maps = Path("/proc/self/maps").read_text().splitlines()
target = numba.core.registry.cpu_target.target_context.codegen().magic_tuple()
print(json.dumps({
    "OpenBLAS": sorted({core(line.split()[-1]) for line in maps if "openblas" in line}),
    "numpy": numpy.show_config(mode="dicts")["SIMD Extensions"]["found"][-1],
    "numba": target[1:],
}))
"""


@pytest.mark.skipif(not has_avx2(), reason="without AVX2, libraries choose by the processor")
@pytest.mark.parametrize(
    "variables",
    [
        {},
        {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "AVX2"},
        {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "+sse"},
    ],
)
def test_libraries_use_the_same_kernels_on_each_processor_with_avx2(variables, tmp_path):
    program = checkout(tmp_path / "plenoforge") / "scripts/kernels.py"
    program.write_text(KERNELS)
    result = subprocess.run(
        [sys.executable, program],
        env=cleaned(os.environ) | variables,
        capture_output=True,
        text=True,
        check=True,
    )
    kernels = json.loads(result.stdout)
    # Numpy 2.4 has a name for AVX2 with what Cycles needs, too.
    assert kernels.pop("numpy") in ("AVX2", "X86_V3")
    assert kernels == {"OpenBLAS": ["Haswell"], "numba": ["x86-64-v3", ""]}
    # Each numpy passes over the names that it does not know.
    assert not result.stderr


def test_without_avx2_libraries_choose_their_kernels(monkeypatch):
    """OpenBLAS would use AVX2 although the processor has none."""
    assert "OPENBLAS_CORETYPE" in isolation.own_variables() or not has_avx2()
    monkeypatch.setattr(isolation, "has_avx2", lambda: False)
    assert not isolation.own_variables().keys() & {"OPENBLAS_CORETYPE", "NUMBA_CPU_NAME"}


@pytest.mark.parametrize(
    "first_import", ["lightfield.configuration.scene_yaml", "lightfield.imaging.halves"]
)
def test_numbas_options_in_the_current_folder_are_not_read(run_program, tmp_path, first_import):
    written(tmp_path / ".numba_config.yaml", "disable_jit: 1")
    (tmp_path / "kernel.py").write_text(f"import {first_import}\n{KERNEL}")
    run = run_program(tmp_path / "kernel.py", in_fork=False, cwd=tmp_path)
    assert run.stdout == "True\n"


# Compiled kernels have signatures.
KERNEL = """
from lightfield.core.compiled import kernel

@kernel
def double(value):
    return 2 * value

double(1.0)
print(len(double.signatures) == 1)
"""


def test_a_users_matplotlib_settings_do_not_change_a_plot(run_program, tmp_path):
    written(tmp_path / "matplotlibrc", "lines.linewidth: 9\nfont.size: 20\naxes.facecolor: black\n")
    (tmp_path / "clean").mkdir()
    (tmp_path / "draw.py").write_text(DRAW)
    for folder in (tmp_path, tmp_path / "clean"):
        run_program(tmp_path / "draw.py", in_fork=False, cwd=folder)
    first, second = tmp_path / "line.png", tmp_path / "clean/line.png"
    assert first.read_bytes() == second.read_bytes()


DRAW = """
from pathlib import Path
from lightfield.imaging.plots import plot

with plot(Path("line")) as axes:
    axes.plot([0, 1], [0, 1])
"""


@pytest.mark.parametrize("program", sorted(SCRIPTS.glob("*.py")), ids=lambda path: path.stem)
def test_a_program_is_isolated_before_it_imports_any_other_package(program):
    imports = [
        getattr(node, "module", None) or node.names[0].name
        for node in ast.parse(program.read_text()).body
        if isinstance(node, (ast.Import, ast.ImportFrom))
    ]
    packages = [name.partition(".")[0] for name in imports]
    others = [name for name in packages if name not in sys.stdlib_module_names]
    assert others[0] == "lightfield"


@pytest.mark.parametrize("variables, times", [({}, 1), ({"OCIO": "/a"}, 2)])
def test_a_program_starts_anew_only_if_its_environment_may_change_a_byte(variables, times):
    command = [sys.executable, "-X", "importtime", SCRIPTS / "lens_map.py", "--help"]
    environment = cleaned(os.environ) | variables
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert len(re.findall(r"\| site$", result.stderr, re.M)) == times


def test_needed_environment_variables_are_kept():
    needed = {
        "HOME": "/home/me",
        "PATH": "/usr/bin",
        "TMPDIR": "/scratch",
        "LANG": "C.UTF-8",
        "CUDA_VISIBLE_DEVICES": "1",
        "SLURM_JOB_ID": "7",
        "AWS_ACCESS_KEY_ID": "key",
        "PYTHONUNBUFFERED": "1",
        "NUMBA_CACHE_DIR": "/scratch",
        "OMP_NUM_THREADS": "4",
        "LD_LIBRARY_PATH": "/usr/local/nvidia/lib64",
        "https_proxy": "http://proxy",
    }
    changing = {
        "PYTHONPATH": "/a",
        "PYTHONSTARTUP": "/a",
        "LD_PRELOAD": "a.so",
        "OCIO": "/a",
        "BLENDER_USER_SCRIPTS": "/a",
        "NUMBA_DISABLE_JIT": "1",
        "CYCLES_CPU_NO_AVX2": "1",
        "NPY_DISABLE_CPU_FEATURES": "AVX2",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA",
    }
    left = cleaned(needed | changing)
    assert left.items() >= needed.items()
    assert not left.keys() & changing.keys()
    assert cleaned(left) == left
