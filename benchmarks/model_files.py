"""Import other people's model files, and count how many scenes equal what a second reader finds.

Each file below the folders is imported as a scene YAML with `unit: metres` does it. Then its .blend
is opened, and its meshes are compared with the file once more. The program prints how many files

- equal their second reader;
- are equal, but with a note of features that no view shows;
- cannot be judged wholly, because the second reader says so;
- are refused, because a part would be left out or shown differently;
- are refused for another reason: they are broken, or have no faces;
- stop Blender, so that there is no scene;
- are wrong: imported, but different from the file. The program fails if there are any.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Container, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.names import MODELS

VERDICTS = ("equal", "noted", "not judged", "refused as different", "refused", "stopped", "wrong")
# What the refusal says if the second reader, or the import, has found a part that is not shown.
_DIFFERENT = "parts of it would be left out"


class Outcome(NamedTuple):
    """What became of a file: one of `VERDICTS`, why, and the CPU seconds of the second reader."""

    verdict: str
    reason: str
    seconds: float = 0.0


def outcome(path: Path, root: Path) -> Outcome:
    """Import a model file, and compare the saved scene with the file."""
    from lightfield.rendering.imports import model
    from lightfield.rendering.models.second_readers import compare, reading
    from lightfield.rendering.scenes import blend_file
    from lightfield.rendering.scenes.render_graph import in_render
    from lightfield.stages.scene import ImportSettings

    settings = ImportSettings(model=str(path), unit="metres", shared_folder=str(root))
    with tempfile.TemporaryDirectory() as name:
        try:
            record = model.make_scene(settings, Path(name))
        except UserError as error:
            is_different = _DIFFERENT in str(error)
            return Outcome("refused as different" if is_different else "refused", str(error))
        begin = time.process_time()
        facts = reading.read(path, settings.up, settings.frame)
        seconds = time.process_time() - begin
        blend_file.save_scene(Path(name) / "scene.blend")
        blend_file.open_scene(Path(name) / "scene.blend")
        differences = compare.differences(facts, in_render(compare.shown_meshes)) if facts else []
    if differences:
        return Outcome("wrong", "; ".join(differences), seconds)
    if record.get("unjudged"):
        return Outcome("not judged", "; ".join(record["unjudged"]), seconds)
    return Outcome(
        "noted" if record["left_out"] else "equal", "; ".join(record["left_out"]), seconds
    )


def outcomes(files: list[tuple[Path, Path]]) -> Iterator[tuple[Path, Outcome]]:
    """Yield the outcome of each file, which comes with its folder. One process has Blender."""
    pool = ProcessPoolExecutor(1)
    for path, root in files:
        try:
            yield path, pool.submit(outcome, path, root).result()
        except BrokenProcessPool:
            yield path, Outcome("stopped", "Blender crashed")
            pool = ProcessPoolExecutor(1)
        except Exception as error:
            # Whatever is no `UserError` would be a traceback in front of the user.
            yield path, Outcome("wrong", f"{type(error).__name__}: {error}")
    pool.shutdown()


def files_below(folders: Iterable[Path], suffixes: Container[str]) -> list[tuple[Path, Path]]:
    """Return the files with some suffixes below some folders, each with its folder."""
    return [
        (path, folder)
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if path.suffix.lower() in suffixes and path.is_file()
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--suffixes", nargs="+", default=[*MODELS], help="such as .glb")
    parser.add_argument("--list", type=Path, help="JSON to write: what became of each file")
    options = parser.parse_args()
    results = dict(outcomes(files_below(options.folders, options.suffixes)))
    if options.list:
        write_json(options.list, {str(path): [*result] for path, result in results.items()})
    print(f"| format | files | {' | '.join(VERDICTS)} | CPU s a file |")
    for suffixes in sorted({path.suffix.lower() for path in results}):
        own = [result for path, result in results.items() if path.suffix.lower() == suffixes]
        counts = Counter(result.verdict for result in own)
        numbers = " | ".join(str(counts[verdict]) for verdict in VERDICTS)
        seconds = sum(result.seconds for result in own) / len(own)
        print(f"| {suffixes} | {len(own)} | {numbers} | {seconds:.3f} |")
    wrong = [path for path, result in results.items() if result.verdict == "wrong"]
    for path in wrong:
        print(f"{path}: {results[path].reason}")
    if wrong:
        raise UserError(f"{len(wrong)} of {len(results)} files are shown wrongly")


if __name__ == "__main__":
    run(main)
