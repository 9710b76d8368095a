"""A scene with all stages from the .blend to the page, of few and small views."""

from checkouts import checkout, snakemake

NAME = "tiny/LFPlane"
SCENE = """
licence: CC0-1.0
scene: {builder: room}
render: {samples: 4}
rigs:
  LFPlane:
    type: plane
    cameras: [3, 2]
    size: 0.5
    center: [0, 0, 1.2]
    camera: {lens: equidistant, fov: 180, resolution: [24, 24]}
reprojections:
  perspective:
    camera: {lens: rectilinear, fov: 80, resolution: [16, 16]}
    format: png
exports:
  instant_ngp: {sources: [perspective]}
report: {panorama: false}
"""
CHOSEN = ("--config", "scenes=[tiny]", "rigs=all", "preset=full", "views_per_shard=2")
LIGHTFIELD = f"results/{NAME}/lightfield.json"
VIEW = f"results/{NAME}/exr/view_0000f.exr"
TRANSFORMS = f"results/{NAME}/perspective/transforms.json"
BLEND = "work/tiny/scene.blend"
SHARDS = ("0-2", "2-4", "4-6")


def checked_out(folder):
    """Return a checkout with the scene and no results."""
    return checkout(folder, tiny=SCENE)


def build(folder, *arguments):
    """Build the scene in a checkout. Return what Snakemake printed."""
    result = snakemake(folder, "--cores", "2", *CHOSEN, *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout + result.stderr


def edit(folder, old, new):
    """Replace a text in the scene YAML."""
    path = folder / "configs/scenes/tiny.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
