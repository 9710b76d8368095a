"""Names that quick programs and their --help need. The modules of their subjects load slowly."""

from pathlib import Path
from typing import Literal, get_args

# The name of the rendered views among a dataset's reprojections.
VIEWS = "views"
# The folder of their shards' receipts, logs and times, beside the folders of the reprojections.
RENDERED = "render"

# The folder of a dataset with the surface that its cameras can see.
MESH = "mesh"
# The folder of a dataset with its turntable or walk.
VIDEO = "video"
# The folder of a dataset with the files of an inertial sensor (IMU), and the key of its settings in
# lightfield.json.
IMU = "imu"

# The file that lists which of a scene's views are in which part of the split.
SPLITS = "splits.json"
# The file that lists which views the cameras of a head take at the same place.
HEADS = "heads.json"
Part = Literal["train", "validation", "test"]
PARTS: tuple[Part, ...] = get_args(Part)

# The page of a whole sequence, in a report's folder beside the frames.
SEQUENCE_PAGE = "sequence.html"

# The file of a package, and of a published dataset, that reads it without Plenoforge.
READER = "read.py"

# The file that lists the members of a family.
CORPUS = "corpus.json"

# The word in a scene YAML that stands for the .blend's own value.
FILE = "file"

# The help of all flags --inventory.
INVENTORY = "JSON that scripts/inventory.py wrote for the scene"

# The formats of model files that scripts/import_model.py reads.
MODELS = (".fbx", ".glb", ".gltf", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")
# The usual up axis of formats whose files do not say which axis points up.
UP = {".obj": "y", ".ply": "z", ".stl": "z"}
SOFTBOXES = "softboxes"
# The lights of a model: lamps, or an environment that ships with bpy.
LIGHTS = (
    SOFTBOXES,
    "city",
    "courtyard",
    "forest",
    "interior",
    "night",
    "studio",
    "sunrise",
    "sunset",
)

# The folder of the repository.
ROOT = Path(__file__).resolve().parents[3]
BUILDERS = ROOT / "scripts" / "scenes"


def builders() -> list[str]:
    """Return the names of the scene builders: the folders of scripts/scenes/ except library."""
    folders = (file.parent.name for file in BUILDERS.glob("*/__init__.py"))
    return sorted(name for name in folders if name != "library")


def scene_folder(scene: str, preset: str) -> str:
    """Return the folder of a scene or family under its preset: garden, or garden_tiny."""
    return scene if preset == "full" else f"{scene}_{preset}"
