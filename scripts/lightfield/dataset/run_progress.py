"""How far a dataset and the whole run are, whichever processes render them."""

import time
from pathlib import Path

from lightfield.core.files import read_json
from lightfield.core.progress import duration
from lightfield.dataset import keys
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.imaging import images


class DatasetProgress:
    """Counts a dataset's finished views, whoever renders them; looks at each finished one once.

    ``folder`` is that of the views.
    """

    def __init__(self, lightfield: LightField, folder: Path) -> None:
        self.total = len(lightfield.views)
        self._missing = {
            folder / f"{view.name}.exr": keys.render_key(lightfield, view)
            for view in lightfield.views
        }

    def look(self) -> None:
        """Find out which of the views that were missing are finished by now."""
        self._missing = {p: key for p, key in self._missing.items() if not images.has_key(p, key)}

    @property
    def count(self) -> int:
        return self.total - len(self._missing)


class RunProgress:
    """Ends a shard's progress lines with those of the whole dataset and of the whole run.

    ``own`` views are the shard's. ``run`` is a JSON of how many views each dataset of the run has,
    by the dataset's folder. The time left is at the rate of all shards since this one began.
    """

    def __init__(self, own: int, lightfield: LightField, folder: Path, run: Path | None) -> None:
        self._own = own
        self._dataset = DatasetProgress(lightfield, folder)
        self._run: dict[str, int] = read_json(run) if run else {}
        # It lists what was chosen, and this may have been asked for by name.
        if str(folder.parent) not in self._run:
            self._run = {}
        self._datasets = {str(folder.parent): self._dataset}
        self._began, self._first = time.monotonic(), self._count()

    def __call__(self) -> str:
        done, total, text = self._count(), sum(self._run.values()), ""
        if self._own < self._dataset.total:
            text = f"; of the whole dataset {self._dataset.count} of {self._dataset.total}"
        if self._own < total:
            text += f"; of the run {done} of {total}"
            if self._first < done < total:
                each = (time.monotonic() - self._began) / (done - self._first)
                text += f", {duration(each * (total - done))} left"
        return text

    def _count(self) -> int:
        """Return how many views of the run are finished."""
        for name in self._run.keys() - self._datasets.keys():
            # Another job makes it when its turn has come.
            path = Path(name, NAME)
            if path.exists():
                self._datasets[name] = DatasetProgress(LightField.read(path), Path(name, "exr"))
        for dataset in self._datasets.values():
            dataset.look()
        return sum(dataset.count for dataset in self._datasets.values())
