"""The barbers' tools, lying on z = 0."""

import bpy
import numpy as np

from scenes.library.model import Model
from scenes.library.points import points, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import copies, tube

BLADE = "prism 0.0018, -0.005 -0.01, 0.006 -0.01, 0.007 0.02, 0.001 0.10, -0.002 0.10"
TOOLS = f"""
Scissors |
    Steel: {BLADE} at 0 0 0.002 turned 0 0 -11
    Steel: {BLADE} at 0 0 0.004 turned 0 0 11
    Steel: tube 0.003, 0 -0.008 0.004, 0.016 -0.05 0.004
    Steel: tube 0.003, 0 -0.008 0.004, -0.016 -0.05 0.004
    Steel: ring 0.014 0.003 at ±0.02 -0.064 0.004
    Brass: lathe 0.004 0, 0.004 0.007, 0 0.0075
Razor |
    Ebony: box 0.014 0.14 0.008 0.003 at 0 0 0.004
    Chrome: prism 0.0025, 0 0, 0.02 0.004, 0.02 0.075, 0.004 0.08, 0 0.07
        at 0.003 0.068 0.003 turned 0 0 -55
    Brass: lathe 0.004 0, 0.004 0.010, 0 0.011 at 0 0.062 0
Hair dryer |
    Chrome: lathe 0.02 -0.07, 0.038 -0.05, 0.04 0.02, 0.026 0.05, 0.024 0.13
        0.028 0.135 at 0 0 0.041 turned 90 0 0
    Black: box 0.12 0.034 0.03 0.012 3 at 0.085 0.02 0.036 turned 0 4 -10
    Red: ring 0.03 0.003 at 0 -0.02 0.041 turned 90 0 0
"""
CLIPPERS = """Black: box 0.048 0.14 0.036 0.014 3 at 0 0 0.019
    Steel: box 0.044 0.03 0.006 at 0 0.082 0.026 turned 20 0 0
    Steel: box 0.0015 0.012 0.003 at -0.02..0.02*14 0.101 0.032 turned 20 0 0
    Gilt: box 0.03 0.06 0.003 0.001 at 0 -0.005 0.037"""


def clippers(scene: Scene) -> bpy.types.Mesh:
    """Electric clippers with a coiled cord."""
    model, s = Model(scene, CLIPPERS), np.linspace(0, 1, scene.segments(140, 16))
    coil = xyz(0.012 * np.cos(70 * s) + 0.1 * s, -0.08 - 0.13 * s, 0.014 + 0.01 * np.sin(70 * s))
    model.add(scene.tube(coil, 0.0022, 5), "Black")
    return model.mesh("Clippers")


def comb(scene: Scene, material: str) -> bpy.types.Mesh:
    """A comb with fine teeth on one half and coarse ones on the other."""
    model = Model(scene, f"{material}: box 0.17 0.01 0.004 0.0015 at 0 0.012 0.002")
    x = np.linspace(-0.083, 0.083, scene.count(46, 8))
    x = np.concatenate([x[: len(x) // 2], x[len(x) // 2 :: 2]])
    model.box((0.0018, 0.024, 0.0026), material, xyz(x, -0.004, 0.002))
    return model.mesh(f"Comb {material.lower()}")


def hair_brush(scene: Scene) -> bpy.types.Mesh:
    """A round-backed brush, its bristles up."""
    model = Model(scene, "Oak: box 0.055 0.10 0.014 0.006 3 at 0 0.05 0.007")
    handle = scene.tube("0 0 0.007, 0 -0.04 0.007, 0 -0.10 0.007", (0.007, 0.010, 0.007), 12)
    model.add(handle, "Oak")
    columns, rows = scene.segments(6, 2), scene.segments(11, 3)
    roots = points(f"-0.02..0.02*{columns} 0.01..0.09*{rows} 0.013")
    upwards = roots * (6.7, 0, 0) + xyz(0, 0, 1)
    hairs = copies(tube("0 0 0, 0 0.015 0", 0.0016, 4), roots, forward=upwards, up=(0, 1, 0))
    model.add(hairs, "Bristle")
    return model.mesh("Hair brush")
