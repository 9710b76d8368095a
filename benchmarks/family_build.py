"""A build of families in a folder of its own, which a benchmark kills and starts again."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import write_json, write_text
from lightfield.core.names import ROOT
from lightfield.engine import receipts


class FamilyBuild:
    """Builds scene YAMLs in ``root``. ``scenes`` are their texts, by their names."""

    def __init__(self, root: Path, scenes: Mapping[str, str], cores: int) -> None:
        self.root = root
        self.cores = cores
        for name, text in scenes.items():
            write_text(root / f"configs/scenes/{name}.yaml", text)
        settings = {"scenes": [*scenes], "rigs": "all", "preset": "full", "device": "cpu"}
        write_json(root / "config.yaml", settings)

    def start(self) -> subprocess.Popen[str]:
        """Start Snakemake in a process group of its own."""
        snakemake = str(Path(sys.executable).with_name("snakemake"))
        command = [snakemake, "--snakefile", str(ROOT / "Snakefile"), "--cores", str(self.cores)]
        return subprocess.Popen(
            command,
            cwd=self.root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            start_new_session=True,
        )

    def recorded(self) -> int:
        """Return how many members have a record."""
        return len([*self.root.glob("results/*/*/member.json")])

    def begun(self) -> Counter[tuple[str, str]]:
        """Return how often each member was begun, by family and name."""
        files = self.root.glob("work/receipts/*/batches/*.*")
        return Counter(
            (path.parts[-3], line["member"])
            for path in {file.with_suffix(receipts.SUFFIX) for file in files}
            for line in receipts.history(path)
            if "began" in line
        )

    def kill_after(self, members: int) -> None:
        """Build until so many members are recorded, then kill the build."""
        process = self.start()
        while self.recorded() < members:
            if process.poll() is not None:
                raise UserError(f"the build ended before the kill:\n{process.communicate()[0]}")
            time.sleep(0.2)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()

    def finish(self) -> list[str]:
        """Build to the end. Return the lines that count the members of each family."""
        output, _ = self.start().communicate()
        lines = [line for line in output.splitlines() if " members of " in line]
        counts = [line for line in lines if " built" in line]
        if not counts:
            raise UserError(f"the build failed:\n{output}")
        return counts
