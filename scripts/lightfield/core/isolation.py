"""Programs run isolated: what a user's environment says to their libraries changes no byte.

Some variables act when Python starts, some when a library is loaded, and Blender reads colours,
start-up scripts and add-ons from the user's home. So a program starts itself anew, once, before it
has done anything, in an environment without all that. It keeps its process and its arguments.
"""

import os
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

_SCRIPTS = Path(__file__).resolve().parents[2]
_PROGRAM_FOLDERS = {_SCRIPTS, _SCRIPTS.parent / "benchmarks"}

# How the names begin of variables that change what a program computes, by what reads them.
_REMOVED = (
    # Python: modules of other folders, a sitecustomize, assertions left out.
    "PYTHON",
    # Blender and Cycles: folders, colours, kernels and the instructions that they use.
    *("BLENDER_", "CYCLES_"),
    # What Blender is made of: colours, images, shaders, scenes in USD, denoising.
    *("OCIO", "OIIO_", "OPENIMAGEIO_", "OSL_", "MATERIALX_", "PXR_", "OIDN_"),
    # The arithmetic of kernels, arrays and the C library: with or without compiler or instructions.
    *("NUMBA_", "NPY_", "OPENBLAS_CORETYPE", "GLIBC_TUNABLES"),
    # The system's loader: libraries in place of others.
    *("LD_PRELOAD", "LD_AUDIT"),
)
# Of these, what says only how to print, and where to keep what is compiled.
_KEPT = {
    *("PYTHONDONTWRITEBYTECODE", "PYTHONIOENCODING", "PYTHONPYCACHEPREFIX", "PYTHONUNBUFFERED"),
    *("PYTHONUTF8", "NUMBA_CACHE_DIR"),
}
# The option of Python's command line by which a program knows that it is isolated.
_MARK = "isolated"


def isolate() -> None:
    """Start this program anew in a cleaned environment, if it is not isolated yet.

    Where something else runs, as Snakemake or a test, nothing happens.
    """
    if _MARK not in sys._xoptions and _is_program():
        # Without the packages in the user's home (-s), too.
        command = [sys.executable, "-s", "-X", _MARK, *sys.orig_argv[1:]]
        folder = {"BLENDER_USER_RESOURCES": str(_folder_without_user_files())}
        os.execve(sys.executable, command, cleaned(os.environ) | folder)


def _is_program() -> bool:
    """Whether the command line runs one of our programs."""
    main = getattr(sys.modules["__main__"], "__file__", None)
    if main is None or Path(main).resolve().parent not in _PROGRAM_FOLDERS:
        return False
    # A test may run a program in its own process.
    return Path(main).resolve() in {Path(word).resolve() for word in sys.orig_argv[1:]}


def cleaned(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without what may change a byte of a dataset."""
    kept = {
        name: value
        for name, value in environment.items()
        if name in _KEPT or not name.startswith(_REMOVED)
    }
    if folders := _harmless_folders(kept.pop("LD_LIBRARY_PATH", "")):
        kept["LD_LIBRARY_PATH"] = folders
    return kept


def _harmless_folders(library_path: str) -> str:
    """Return a list of folders without those that hold a library which a package brings itself.

    The loader would take that one instead of the package's, as TBB's or a denoiser's of another
    version on a cluster. The others may have what Python itself or a GPU needs.
    """
    packages = Path(sysconfig.get_path("platlib"))
    libraries = {library.name for library in packages.glob("*/lib/*.so*")}
    return os.pathsep.join(
        folder
        for folder in library_path.split(os.pathsep)
        if folder and not any(Path(folder, name).exists() for name in libraries)
    )


def _folder_without_user_files() -> Path:
    """Return the folder that Blender takes for that of the user's files; it notes there what it is.

    It must be there, or Blender takes the one in the user's home.
    """
    here = Path(__file__).parent
    folder = here / "__pycache__" / f"blender-{sys.implementation.cache_tag}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        # Where nothing can be written, nothing of Blender's can be here either.
        return here
    return folder
