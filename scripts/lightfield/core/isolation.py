"""Isolates programs from the user's environment, so that it changes no byte of their output.

Some variables act when Python starts, and some when a library is loaded. Blender reads colours,
start-up scripts and add-ons from the user's home. So a program that finds any of these restarts
itself in a clean environment. It keeps its process and its arguments.

Libraries choose kernels by the processor, and their last digits differ. So variables of ours make
them use the kernels that all processors with AVX2 have.
"""

import os
import site
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

from lightfield.core.machine import has_avx2
from lightfield.core.terminal import report_interrupts

_SCRIPTS = Path(__file__).resolve().parents[2]
# An installed library lies beside other packages, which are no programs of ours.
_IS_INSTALLED = _SCRIPTS.name != "scripts"
_PROGRAM_FOLDERS = set() if _IS_INSTALLED else {_SCRIPTS, _SCRIPTS.parent / "benchmarks"}

# Prefixes of variables that change what a program computes, by what reads them.
_REMOVED = (
    # Python: modules of other folders, a sitecustomize, no assertions.
    "PYTHON",
    # Blender and Cycles: folders, colours, kernels and the instructions that they use.
    "BLENDER_",
    "CYCLES_",
    # Blender's libraries: colours, images, shaders, scenes in USD, denoising.
    "OCIO",
    "OIIO_",
    "OPENIMAGEIO_",
    "OSL_",
    "MATERIALX_",
    "PXR_",
    "OIDN_",
    # Plug-ins that check settings, of any package that is installed.
    "PYDANTIC_",
    # The arithmetic of kernels, arrays and the C library: compiler and instructions.
    "NUMBA_",
    "NPY_",
    "OPENBLAS_CORETYPE",
    "GLIBC_TUNABLES",
    # The system's loader: libraries in place of others.
    "LD_PRELOAD",
    "LD_AUDIT",
)
# Exceptions: these variables change only what is printed, or where compiled files lie.
_HARMLESS = {
    "PYTHONDONTWRITEBYTECODE",
    "PYTHONIOENCODING",
    "PYTHONPYCACHEPREFIX",
    "PYTHONUNBUFFERED",
    "PYTHONUTF8",
    "NUMBA_CACHE_DIR",
}
# The kernels that libraries use on any processor with AVX2.
_AVX2_KERNELS = {
    "OPENBLAS_CORETYPE": "Haswell",
    # The names in numpy 1.26, and in 2.4. Numpy passes over the others, with a hidden warning.
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL "
    "AVX512_SPR X86_V4",
    "NUMBA_CPU_NAME": "x86-64-v3",
    # None beside the features of this name.
    "NUMBA_CPU_FEATURES": "",
}


def isolate() -> None:
    """Start this program anew in a cleaned environment, unless its environment is clean.

    Does nothing in other processes, such as Snakemake or a test.
    """
    if not _is_program():
        return
    report_interrupts()
    added = own_variables()
    environment = cleaned(os.environ) | added
    if environment == os.environ | added and not site.ENABLE_USER_SITE:
        # Only libraries read these, and none is loaded yet.
        os.environ.update(added)
        return
    # -s excludes the packages in the user's home.
    os.execve(sys.executable, [sys.executable, "-s", *sys.orig_argv[1:]], environment)


def _is_program() -> bool:
    """Return whether the command line runs one of our programs."""
    main = getattr(sys.modules["__main__"], "__file__", None)
    if main is None or Path(main).resolve().parent not in _PROGRAM_FOLDERS:
        return False
    # A test may run a program in its own process.
    return Path(main).resolve() in {Path(word).resolve() for word in sys.orig_argv[1:]}


def cleaned(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without the variables that may change a byte of a dataset."""
    variables = {
        name: value
        for name, value in environment.items()
        if name in _HARMLESS or not name.startswith(_REMOVED)
    }
    if folders := _harmless_folders(variables.pop("LD_LIBRARY_PATH", "")):
        variables["LD_LIBRARY_PATH"] = folders
    return variables


def own_variables() -> dict[str, str]:
    """Return the variables that each program sets."""
    # Without AVX2, these kernels would end the program.
    kernels = _AVX2_KERNELS if has_avx2() else {}
    return kernels | {
        "BLENDER_USER_RESOURCES": str(_folder_without_user_files()),
        "PYDANTIC_DISABLE_PLUGINS": "__all__",
    }


def _harmless_folders(library_path: str) -> str:
    """Remove the folders that hold a library which a Python package brings itself.

    The loader would prefer the folder's library to the package's. On a cluster this may be another
    version of TBB or of the denoiser. Python or a GPU may need the remaining folders.
    """
    if not library_path:
        return ""
    packages = Path(sysconfig.get_path("platlib"))
    libraries = {library.name for library in packages.glob("*/lib/*.so*")}
    return os.pathsep.join(
        folder
        for folder in library_path.split(os.pathsep)
        if folder and not any(Path(folder, name).exists() for name in libraries)
    )


def _folder_without_user_files() -> Path:
    """Return an empty folder that Blender takes for the user's, and into which it writes notes.

    The folder must exist, or Blender takes the one in the user's home.
    """
    package = Path(__file__).parent
    folder = package / "__pycache__" / f"blender-{sys.implementation.cache_tag}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        # This folder is read-only, so Blender cannot have written anything here either.
        return package
    return folder
