"""Install the system packages that the environment needs, as root on Debian or Ubuntu.

Elsewhere, and without root, name the missing packages. They are the libraries that bpy links to,
Python's module for environments, and for the tests a browser, ffmpeg and rsync. This uses only the
standard library, because it runs before anything is installed.
"""

import argparse
import ctypes
import importlib
import importlib.util
import os
import shutil
import subprocess
import sys

# Shared library: Debian and Ubuntu package.
LIBRARIES = {
    "libX11.so.6": "libx11-6",
    "libXi.so.6": "libxi6",
    "libXfixes.so.3": "libxfixes3",
    "libXrender.so.1": "libxrender1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libGL.so.1": "libgl1",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", action="store_true", help="also the packages of the tests")
    tests = parser.parse_args().tests
    packages = missing(tests)
    if not packages:
        return
    if shutil.which("apt-get") and os.geteuid() == 0:
        print(f"installing {' '.join(packages)}", flush=True)
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        for arguments in (["update"], ["install", "--yes", *packages]):
            subprocess.run(["apt-get", "--quiet=2", *arguments], env=environment, check=False)
        importlib.invalidate_caches()
        packages = missing(tests)
    if packages:
        sys.exit(
            "error: system packages are missing; on Debian or Ubuntu: "
            f"sudo apt-get install {' '.join(packages)}"
        )


def missing(tests: bool) -> list[str]:
    """Return the missing Debian packages."""
    packages = []
    if sys.platform == "linux":
        packages = [package for library, package in LIBRARIES.items() if not loads(library)]
    if not importlib.util.find_spec("ensurepip"):
        packages.append("python{}.{}-venv".format(*sys.version_info))
    if tests:
        packages += [name for name in ("chromium", "ffmpeg", "rsync") if not shutil.which(name)]
    return packages


def loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    main()
