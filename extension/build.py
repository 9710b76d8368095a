"""Write the Blender extension: a zip for Blender's "Install from Disk".

The zip holds the code of this folder, the parts of the library that it uses, and the wheels that
Blender's Python lacks. pip downloads the wheels of the versions in the lock.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
LIBRARY = ROOT / "scripts" / "lightfield"
# The parts of the library that the extension uses, and all that they import.
PARTS = (
    "core",
    "settings",
    "engine",
    "geometry",
    "imaging",
    "formats",
    "reading",
    "export",
    "exporters",
    "configuration",
    "rendering/inspection/clearance.py",
)
# Wheels for the systems that the manifest names, and for the Pythons of Blender 5.0 and later.
# Linux distributions build Blender with a later Python.
PACKAGES = "pydantic pydantic-core pyyaml annotated-types typing-extensions typing-inspection"
LOCK = ROOT / "envs" / "requirements-3.13.txt"
PYTHONS = ("3.11", "3.13", "3.14")
SYSTEMS = ("manylinux_2_17_x86_64", "macosx_11_0_arm64")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="folder to write the zip to")
    folder = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as wheels:
        download(Path(wheels))
        print(write(folder, sorted(Path(wheels).glob("*.whl"))))


def write(folder: Path, wheels: Sequence[Path]) -> Path:
    """Write the zip to a folder, and return its path."""
    manifest = (HERE / "blender_manifest.toml").read_text(encoding="utf-8")
    about = tomllib.loads(manifest)
    listed = json.dumps([f"./wheels/{wheel.name}" for wheel in wheels], indent=2)
    files = {
        "blender_manifest.toml": manifest.replace("\n[perm", f"\nwheels = {listed}\n\n[perm"),
        "LICENSE": (ROOT / "LICENSE").read_bytes(),
        **{path.name: path.read_bytes() for path in HERE.glob("*.py") if path.name != "build.py"},
        **dict(library()),
        **{f"wheels/{wheel.name}": wheel.read_bytes() for wheel in wheels},
    }
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{about['id'].replace('_', '-')}-{about['version']}.zip"
    temporary = target.with_suffix(".tmp")
    with zipfile.ZipFile(temporary, "w") as archive:
        for name in sorted(files):
            # The time is always the same, so that equal files give equal bytes.
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    temporary.replace(target)
    return target


def library() -> Iterator[tuple[str, str]]:
    """Yield the library's files, with relative imports: no other add-on can have their names."""
    names = [path for part in PARTS for path in sorted((LIBRARY / part).rglob("*.py"))]
    names += [LIBRARY / part for part in PARTS if part.endswith(".py")]
    rooms = ("", "rendering", "rendering/inspection")
    packages = [LIBRARY / room / "__init__.py" for room in rooms]
    for path in (*packages, *names):
        dots = "." * len(path.relative_to(LIBRARY).parts)
        text = path.read_text(encoding="utf-8")
        text = re.sub(r"^(\s*from )lightfield\.", rf"\1{dots}", text, flags=re.M)
        text = re.sub(r"^(\s*from )lightfield ", rf"\1{dots} ", text, flags=re.M)
        yield str(path.relative_to(ROOT)), text
    # A scene YAML may name each builder that has a folder.
    for path in sorted((ROOT / "scripts" / "scenes").glob("*/__init__.py")):
        yield str(path.relative_to(ROOT)), ""


def download(folder: Path) -> None:
    """Download the wheels of the lock's versions, with their checksums."""
    blocks = re.findall(r"^[\w.-]+==(?:.*\\\n)*.*\n", LOCK.read_text(encoding="utf-8"), re.M)
    pinned = [block for block in blocks if block.partition("==")[0].lower() in PACKAGES.split()]
    with tempfile.NamedTemporaryFile("w", suffix=".txt", encoding="utf-8") as requirements:
        requirements.write("".join(pinned))
        requirements.flush()
        for python in PYTHONS:
            for system in SYSTEMS:
                pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check", "download"]
                choice = ["--only-binary=:all:", "--require-hashes", "--no-deps"]
                machine = ["--platform", system, "--python-version", python]
                subprocess.run(
                    [*pip, *choice, *machine, "-d", folder, "-r", requirements.name], check=True
                )


if __name__ == "__main__":
    main()
