"""What the cloister is made of: warm limestone, ochre plaster, brick and terracotta, and greens.

Textures are in world space, so that no two instances are alike.
"""

import bpy

from scenes.library import materials
from scenes.library.materials import foliage, metal, plain
from scenes.library.nodes import Color, MaterialGraph


def palette() -> dict[str, bpy.types.Material]:
    """Every material of the cloister; colours are linear."""
    mortar = ((0.42, 0.36, 0.28), (0.30, 0.25, 0.19))
    return materials.by_name(
        [
            matte("Limestone", (0.40, 0.33, 0.24), (0.58, 0.50, 0.38), 4.0),
            matte("Carved stone", (0.42, 0.35, 0.26), (0.62, 0.54, 0.42), 5.0, variety=0.15),
            matte("Paving", (0.25, 0.21, 0.17), (0.44, 0.38, 0.31), 2.5, variety=0.45),
            matte("Terracotta floor", (0.27, 0.11, 0.06), (0.40, 0.19, 0.11), 3.0, variety=0.4),
            matte("Roof tile", (0.26, 0.10, 0.05), (0.50, 0.25, 0.14), 2.5, 0.003, 60.0, 0.55),
            matte("Pot", (0.38, 0.15, 0.08), (0.50, 0.23, 0.13), 6.0, 0.002),
            matte("Soil", (0.06, 0.04, 0.025), (0.13, 0.09, 0.055), 5.0, 0.03, 25.0),
            matte("Turf", (0.035, 0.055, 0.012), (0.09, 0.10, 0.03), 3.0, 0.03, 25.0),
            matte("Dry earth", (0.24, 0.19, 0.13), (0.34, 0.28, 0.20), 2.0, 0.015, 20.0),
            matte("Wood", (0.10, 0.055, 0.028), (0.20, 0.115, 0.06), 9.0, 0.004, 50.0, 0.4),
            matte("Bark", (0.09, 0.07, 0.05), (0.22, 0.18, 0.14), 9.0, 0.02, 22.0),
            matte("Iron", (0.02, 0.02, 0.02), (0.07, 0.05, 0.04), 20.0, 0.002),
            matte("Lead", (0.16, 0.15, 0.14), (0.26, 0.25, 0.24), 4.0, 0.002),
            matte("Rope", (0.30, 0.22, 0.12), (0.45, 0.35, 0.20), 40.0, 0.003),
            matte("Robe", (0.075, 0.042, 0.022), (0.115, 0.066, 0.036), 6.0, 0.0008, 150.0, 0.0),
            matte("Skin", (0.45, 0.25, 0.16), (0.50, 0.29, 0.19), 10.0, 0.0005, 60.0, 0.0),
            courses("Brick", (0.33, 0.14, 0.08), (0.50, 0.27, 0.16), mortar[0], (0.30, 0.075)),
            courses("Ashlar", (0.36, 0.29, 0.20), (0.52, 0.43, 0.31), mortar[1], (0.60, 0.29)),
            plaster("Plaster", (0.62, 0.47, 0.29), (0.44, 0.36, 0.26)),
            plaster("Whitewash", (0.70, 0.65, 0.56), (0.55, 0.47, 0.37)),
            foliage("Grass", (0.055, 0.10, 0.018), (0.15, 0.19, 0.045), 0.35),
            foliage("Olive leaf", (0.075, 0.10, 0.045), (0.21, 0.24, 0.14), 0.35),
            foliage("Box leaf", (0.03, 0.075, 0.016), (0.10, 0.17, 0.035), 0.15),
            foliage("Cypress leaf", (0.018, 0.045, 0.016), (0.055, 0.10, 0.032), 0.15),
            foliage("Ivy leaf", (0.02, 0.06, 0.014), (0.10, 0.17, 0.04), 0.35),
            foliage("Lavender", (0.14, 0.07, 0.30), (0.30, 0.17, 0.50), 0.35),
            foliage("Petal", (0.50, 0.015, 0.02), (0.75, 0.06, 0.07), 0.35),
            foliage("Daisy", (0.75, 0.72, 0.65), (0.85, 0.83, 0.78), 0.35),
            foliage("Dead leaf", (0.16, 0.08, 0.03), (0.35, 0.22, 0.08), 0.35),
            plain("Glass", (0.02, 0.025, 0.03), Roughness=0.08),
            plain("Water", (0.01, 0.015, 0.012), Roughness=0.02),
            metal("Bronze", (0.28, 0.17, 0.07), 0.45),
        ]
    )


def matte(
    name: str,
    dark: Color,
    light: Color,
    scale: float,
    bump: float = 0.004,
    bump_scale: float = 30.0,
    variety: float = 0.35,
) -> bpy.types.Material:
    """Blotches between two colours, grain, and a shade for every single piece."""
    graph = MaterialGraph(name)
    position = graph.add("ShaderNodeNewGeometry").outputs["Position"]
    blotches = graph.span(graph.noise(position, scale, 2.0, 0.6), 0, 1, 0.3, 0.7)
    shade = graph.piece_tint((1 - variety,) * 3, (1 + variety / 2,) * 3)
    color = graph.mix(1.0, graph.mix(blotches, dark, light), shade, "MULTIPLY")
    grain = graph.noise(position, bump_scale, 1.0)
    return graph.finish(graph.diffuse(color, graph.bump(grain, bump)))


def courses(
    name: str, dark: Color, light: Color, mortar: Color, brick: tuple[float, float]
) -> bpy.types.Material:
    """Courses of brick or stone on upright walls along the axes; brick is width and height."""
    graph = MaterialGraph(name)
    position = graph.add("ShaderNodeNewGeometry").outputs["Position"]
    x, y, z = graph.xyz(position)
    flat = graph.add("ShaderNodeCombineXYZ", {"X": graph.math("ADD", x, y), "Y": z})
    tints = {"Color1": dark, "Color2": light, "Mortar": mortar}
    sizes = {"Scale": 1.0, "Brick Width": brick[0], "Row Height": brick[1]}
    joints = {"Mortar Size": 0.01, "Mortar Smooth": 0.3}
    bricks = graph.add("ShaderNodeTexBrick", {"Vector": flat} | tints | sizes | joints)
    stains = graph.span(graph.noise(position, 0.9, 2.0, 0.65), 0.7, 1.15, 0.3, 0.7)
    color = graph.mix(1.0, bricks.outputs["Color"], stains, "MULTIPLY")
    return graph.finish(graph.diffuse(color, graph.bump(bricks.outputs["Fac"], -0.012)))


def plaster(name: str, color: Color, worn: Color) -> bpy.types.Material:
    """Old plaster: worn patches, and streaks that the rain drew downwards."""
    graph = MaterialGraph(name)
    position = graph.add("ShaderNodeNewGeometry").outputs["Position"]
    patches = graph.span(graph.noise(position, 0.7, 3.0, 0.65), 0, 1, 0.42, 0.62)
    down = {0: position, 1: (5.0, 5.0, 0.35)}
    drawn = graph.add("ShaderNodeVectorMath", down, operation="MULTIPLY")
    streaks = graph.span(graph.noise(drawn, 1.0, 2.0), 0.7, 1.1, 0.3, 0.65)
    mixed = graph.mix(1.0, graph.mix(patches, color, worn), streaks, "MULTIPLY")
    grain = graph.noise(position, 14.0, 2.0)
    return graph.finish(graph.diffuse(mixed, graph.bump(grain, 0.01)))
