"""The SHA-256 of all that a builder makes: `python scene_fingerprint.py BUILDER SEED` prints it."""

import hashlib
import importlib
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def fingerprint(builder, seed, hash_seed):
    """Build in a process whose sets and dictionaries are hashed by ``hash_seed``."""
    result = subprocess.run(
        [sys.executable, __file__, builder, str(seed)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(ROOT / "scripts"), "PYTHONHASHSEED": hash_seed},
    )
    return result.stdout.split("fingerprint ")[1].split()[0]


def main():
    import bpy
    import numpy as np

    def values(collection, name, size, kind):
        found = np.empty(size * len(collection), kind)
        collection.foreach_get(name, found)
        return found.tobytes()

    builder, seed = sys.argv[1:]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    importlib.import_module(f"scenes.{builder}").build({"seed": int(seed), "detail": 0.05})
    digest = hashlib.sha256()
    for thing in sorted(bpy.data.objects, key=lambda each: each.name):
        digest.update(thing.name.encode() + np.array(thing.matrix_world).tobytes())
        if thing.type == "MESH":
            digest.update(values(thing.data.vertices, "co", 3, np.float32))
            digest.update(values(thing.data.loops, "vertex_index", 1, np.int32))
            digest.update(values(thing.data.polygons, "material_index", 1, np.int32))
        elif thing.type == "CURVES":
            digest.update(values(thing.data.points, "position", 3, np.float32))
    print("fingerprint", digest.hexdigest())


if __name__ == "__main__":
    main()
