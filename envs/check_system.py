"""Check what the environment cannot bring along: Python 3.11 and the libraries that bpy links to.

Uses the standard library only, because it runs before anything is installed.
"""

import ctypes
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
    problems = []
    if sys.version_info[:2] != (3, 11):
        found = ".".join(map(str, sys.version_info[:2]))
        problems.append(
            f"Python 3.11 is needed (bpy 5.0 has no other); this is {found}. "
            "Name another with: make PYTHON=/path/to/python3.11"
        )
    if sys.platform == "linux":
        missing = [package for library, package in LIBRARIES.items() if not loads(library)]
        if missing:
            problems.append(
                "Blender needs system libraries that are not installed; on Debian or Ubuntu:\n"
                f"  sudo apt-get install {' '.join(missing)}"
            )
    if problems:
        sys.exit("error: " + "\nerror: ".join(problems))


def loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    main()
