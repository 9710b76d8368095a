"""What the cloister is made of: warm limestone, ochre plaster, brick and terracotta, and greens.

Textures are in world space, so that no two instances are alike.
"""

from scenes.library.materials import Color, MaterialGraph, foliage, plains

# Two colours, the blotches' scale, the grain's height and scale, and how much pieces differ.
MATTE = [
    ("Pot", (0.38, 0.15, 0.08), (0.50, 0.23, 0.13), 6, 0.002, 30, 0.35),
    ("Bark", (0.09, 0.07, 0.05), (0.22, 0.18, 0.14), 9, 0.02, 22, 0.35),
    ("Carved stone", (0.42, 0.35, 0.26), (0.62, 0.54, 0.42), 5, 0.004, 30, 0.15),
    ("Dry earth", (0.24, 0.19, 0.13), (0.34, 0.28, 0.20), 2, 0.015, 20, 0.35),
    ("Iron", (0.02, 0.02, 0.02), (0.07, 0.05, 0.04), 20, 0.002, 30, 0.35),
    ("Lead", (0.16, 0.15, 0.14), (0.26, 0.25, 0.24), 4, 0.002, 30, 0.35),
    ("Limestone", (0.40, 0.33, 0.24), (0.58, 0.50, 0.38), 4, 0.004, 30, 0.35),
    ("Paving", (0.25, 0.21, 0.17), (0.44, 0.38, 0.31), 2.5, 0.004, 30, 0.45),
    ("Robe", (0.075, 0.042, 0.022), (0.115, 0.066, 0.036), 6, 0.0008, 150, 0),
    ("Roof tile", (0.26, 0.10, 0.05), (0.50, 0.25, 0.14), 2.5, 0.003, 60, 0.55),
    ("Rope", (0.30, 0.22, 0.12), (0.45, 0.35, 0.20), 40, 0.003, 30, 0.35),
    ("Skin", (0.45, 0.25, 0.16), (0.50, 0.29, 0.19), 10, 0.0005, 60, 0),
    ("Soil", (0.06, 0.04, 0.025), (0.13, 0.09, 0.055), 5, 0.03, 25, 0.35),
    ("Terracotta floor", (0.27, 0.11, 0.06), (0.40, 0.19, 0.11), 3, 0.004, 30, 0.4),
    ("Turf", (0.035, 0.055, 0.012), (0.09, 0.10, 0.03), 3, 0.03, 25, 0.35),
    ("Wood", (0.10, 0.055, 0.028), (0.20, 0.115, 0.06), 9, 0.004, 50, 0.4),
]
LEAVES = [
    ("Petal", (0.50, 0.015, 0.02), (0.75, 0.06, 0.07), 0.35),
    ("Daisy", (0.75, 0.72, 0.65), (0.85, 0.83, 0.78), 0.35),
    ("Olive leaf", (0.075, 0.10, 0.045), (0.21, 0.24, 0.14), 0.35),
    ("Box leaf", (0.03, 0.075, 0.016), (0.10, 0.17, 0.035), 0.15),
    ("Grass", (0.055, 0.10, 0.018), (0.15, 0.19, 0.045), 0.35),
    ("Lavender", (0.14, 0.07, 0.30), (0.30, 0.17, 0.50), 0.35),
    ("Ivy leaf", (0.02, 0.06, 0.014), (0.10, 0.17, 0.04), 0.35),
    ("Dead leaf", (0.16, 0.08, 0.03), (0.35, 0.22, 0.08), 0.35),
    ("Cypress leaf", (0.018, 0.045, 0.016), (0.055, 0.10, 0.032), 0.15),
]


def palette() -> None:
    """Every material of the cloister; colours are linear."""
    for row in MATTE:
        matte(*row)
    courses("Brick", (0.33, 0.14, 0.08), (0.50, 0.27, 0.16), (0.42, 0.36, 0.28), 0.30, 0.075)
    courses("Ashlar", (0.36, 0.29, 0.20), (0.52, 0.43, 0.31), (0.30, 0.25, 0.19), 0.60, 0.29)
    plaster("Plaster", (0.62, 0.47, 0.29), (0.44, 0.36, 0.26))
    plaster("Whitewash", (0.70, 0.65, 0.56), (0.55, 0.47, 0.37))
    foliage(LEAVES)
    plains([("Glass", (0.02, 0.025, 0.03), 0.08), ("Water", (0.01, 0.015, 0.012), 0.02)])
    plains([("Bronze", (0.28, 0.17, 0.07), 0.45)], Metallic=1.0)


def matte(
    name: str,
    dark: Color,
    light: Color,
    scale: float,
    bump: float,
    bump_scale: float,
    variety: float,
) -> None:
    """Blotches between two colours, grain, and another shade for every piece.

    scale: of the blotches. bump: the grain's height in metres. bump_scale: of the grain. variety:
    how much the pieces differ.
    """
    graph = MaterialGraph(name)
    position = graph.geometry("Position")
    blotches = graph.span(graph.noise(position, scale, 2.0, 0.6), 0, 1, 0.3, 0.7)
    shade = graph.piece_tint((1 - variety,) * 3, (1 + variety / 2,) * 3)
    color = graph.mix(1.0, graph.mix(blotches, dark, light), shade, "MULTIPLY")
    grain = graph.noise(position, bump_scale, 1.0)
    graph.finish(graph.diffuse(color, Normal=graph.bump(grain, bump)))


def courses(
    name: str, dark: Color, light: Color, mortar: Color, width: float, height: float
) -> None:
    """Courses of bricks or stones of a width and height on upright walls along the axes."""
    graph = MaterialGraph(name)
    position = graph.geometry("Position")
    x, y, z = graph.xyz(position)
    flat = graph.add("CombineXYZ", {"X": graph.math("ADD", x, y), "Y": z})
    tints = {"Color1": dark, "Color2": light, "Mortar": mortar}
    sizes = {"Scale": 1.0, "Brick Width": width, "Row Height": height}
    joints = {"Mortar Size": 0.01, "Mortar Smooth": 0.3}
    bricks = graph.add("TexBrick", {"Vector": flat} | tints | sizes | joints).outputs
    stains = graph.span(graph.noise(position, 0.9, 2.0, 0.65), 0.7, 1.15, 0.3, 0.7)
    color = graph.mix(1.0, bricks["Color"], stains, "MULTIPLY")
    graph.finish(graph.diffuse(color, Normal=graph.bump(bricks["Fac"], -0.012)))


def plaster(name: str, color: Color, worn: Color) -> None:
    """Old plaster: worn patches, and streaks that the rain drew downwards."""
    graph = MaterialGraph(name)
    position = graph.geometry("Position")
    patches = graph.span(graph.noise(position, 0.7, 3.0, 0.65), 0, 1, 0.42, 0.62)
    drawn = graph.vector_math("MULTIPLY", position, (5.0, 5.0, 0.35))[0]
    streaks = graph.span(graph.noise(drawn, 1.0, 2.0), 0.7, 1.1, 0.3, 0.65)
    mixed = graph.mix(1.0, graph.mix(patches, color, worn), streaks, "MULTIPLY")
    grain = graph.noise(position, 14.0, 2.0)
    graph.finish(graph.diffuse(mixed, Normal=graph.bump(grain, 0.01)))
