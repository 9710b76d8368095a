"""What the garden is made of."""

import bpy

from scenes.library import materials
from scenes.library.materials import bark, foliage, metal, plain, thin, wood
from scenes.library.nodes import Color, MaterialGraph


def palette() -> dict[str, bpy.types.Material]:
    """Every material of the garden but those of the flames; colours are linear."""
    return materials.by_name(
        [
            granite("Kerb granite", (0.23, 0.22, 0.20), 0.35),
            granite("Plinth granite", (0.30, 0.29, 0.275), 0.15),
            granite("Lantern granite", (0.25, 0.24, 0.225), 0.55),
            granite("Rock", (0.17, 0.165, 0.155), 0.75),
            paper("Pane paper", (0.86, 0.80, 0.66)),
            paper("Cream globe paper", (0.88, 0.82, 0.68)),
            paper("Red globe paper", (0.78, 0.12, 0.06)),
            paper("Floor lantern paper", (0.88, 0.80, 0.64)),
            wood("Dark wood", (0.022, 0.012, 0.007), (0.14, 0.075, 0.038), 0.42),
            plain("Rope", (0.05, 0.04, 0.03), Roughness=0.9),
            plain("Iron", (0.03, 0.028, 0.026), Metallic=0.8, Roughness=0.55),
            plain("Black lacquer", (0.015, 0.014, 0.013), Roughness=0.35),
            plain("Candle cup", (0.10, 0.03, 0.02), Roughness=0.35),
            plain("Wick", (0.01, 0.01, 0.01)),
            plain("Shrub core", (0.012, 0.02, 0.006), Roughness=1.0),
            metal("Polished brass", (0.75, 0.53, 0.22), 0.16),
            metal("Mirror", (0.93, 0.94, 0.93), 0.0),
            bark("Bark", (0.15, 0.12, 0.09)),
            bark("Maple bark", (0.16, 0.13, 0.11)),
            bark("Pine bark", (0.20, 0.13, 0.09)),
            foliage("Maple leaves", (0.30, 0.018, 0.010), (0.62, 0.13, 0.02), 0.5),
            foliage("Fallen maple leaves", (0.26, 0.02, 0.012), (0.55, 0.17, 0.04), 0.2),
            foliage("Green leaves", (0.03, 0.075, 0.014), (0.10, 0.17, 0.03)),
            foliage("Yellowing leaves", (0.07, 0.10, 0.015), (0.22, 0.22, 0.035)),
            foliage("Autumn leaves", (0.22, 0.09, 0.015), (0.40, 0.22, 0.03)),
            foliage("Pine needles", (0.012, 0.045, 0.016), (0.045, 0.095, 0.026), 0.15),
            foliage("Bamboo leaves", (0.05, 0.11, 0.018), (0.16, 0.22, 0.04)),
            foliage("Azalea leaves", (0.02, 0.055, 0.012), (0.07, 0.13, 0.025), 0.2),
            foliage("Azalea flowers", (0.55, 0.06, 0.20), (0.80, 0.30, 0.45), 0.3),
            foliage("Grass", (0.028, 0.062, 0.010), (0.125, 0.17, 0.032), 0.35),
            foliage("Iris leaves", (0.04, 0.09, 0.02), (0.13, 0.20, 0.05), 0.3),
            foliage("Lily pad", (0.035, 0.09, 0.02), (0.09, 0.17, 0.035), 0.1),
            foliage("Lily petal", (0.72, 0.30, 0.42), (0.85, 0.62, 0.68), 0.3),
        ]
    )


def granite(name: str, tint: Color, moss: float) -> bpy.types.Material:
    """Speckled granite; `moss` 0 … 1 is how far moss has come on what faces upwards."""
    graph = MaterialGraph(name)
    where = graph.coordinates()
    speckle = graph.noise(where, 90.0, 2.0, 0.8)
    broad = graph.noise(where, 3.0, 4.0, 0.6)
    dark, light = (tuple(factor * c for c in tint) for factor in (0.45, 1.5))
    stone = graph.ramp(speckle, [(0.36, dark), (0.5, tint), (0.66, light)])
    stone = graph.mix(graph.span(broad, 0.0, 0.5, 0.35, 0.75), stone, (0.10, 0.095, 0.08))
    normal = graph.add("ShaderNodeNewGeometry").outputs["Normal"]
    upwards = graph.math("ADD", graph.xyz(normal)["Z"], graph.math("MULTIPLY", broad, 1.6))
    cover = graph.span(upwards, 0.0, 1.0, 2.05 - moss, 2.25 - moss)
    green = graph.ramp(speckle, [(0.3, (0.03, 0.05, 0.008)), (0.7, (0.10, 0.13, 0.025))])
    surface = graph.principled(
        Base_Color=graph.mix(cover, stone, green),
        Roughness=graph.span(cover, 0.62, 0.95),
        Normal=graph.bump(speckle, 0.003),
    )
    return graph.finish(graph.plain_when_diffuse(surface, tint))


def paper(name: str, tint: Color) -> bpy.types.Material:
    """Washi paper: half of the light that falls on it comes out at the other side."""
    graph = MaterialGraph(name)
    fibres = graph.noise(graph.coordinates(), 45.0, 4.0, 0.7, 1.0)
    thick = tuple(0.72 * c for c in tint)
    color = graph.mix(graph.span(fibres, 0.0, 0.35, 0.4, 0.7), tint, thick)
    return graph.finish(thin(graph, color, 0.55))
