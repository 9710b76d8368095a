"""The barbershop's materials."""

import numpy as np

from scenes.barbershop.plan import WARM
from scenes.library.materials import Color, MaterialGraph, emissive, plain, plains, wood
from scenes.library.points import Points

PAINTS = [
    ("Cream glaze 0", (0.74, 0.68, 0.55), 0.13),
    ("Cream glaze 1", (0.68, 0.61, 0.47), 0.13),
    ("Cream glaze 2", (0.77, 0.72, 0.61), 0.13),
    ("Green glaze 0", (0.018, 0.085, 0.055), 0.12),
    ("Green glaze 1", (0.013, 0.065, 0.045), 0.12),
    ("Green glaze 2", (0.026, 0.11, 0.068), 0.12),
    ("Leaf 0", (0.035, 0.13, 0.025), 0.42),
    ("Leaf 1", (0.06, 0.19, 0.035), 0.42),
    ("Leaf 2", (0.10, 0.22, 0.06), 0.42),
    ("Brown hair", (0.045, 0.02, 0.009), 0.45),
    ("Fair hair", (0.22, 0.11, 0.04), 0.45),
    ("Black hair", (0.01, 0.008, 0.007), 0.4),
    ("Bristle", (0.42, 0.28, 0.13), 0.8),
    ("Red", (0.50, 0.028, 0.022), 0.35),
    ("Blue", (0.022, 0.065, 0.30), 0.35),
    ("Navy", (0.012, 0.024, 0.075), 0.5),
    ("Teal", (0.02, 0.22, 0.22), 0.4),
    ("Green", (0.02, 0.12, 0.06), 0.4),
    ("Ochre", (0.60, 0.29, 0.04), 0.45),
    ("Skin", (0.62, 0.36, 0.22), 0.6),
    ("White", (0.80, 0.79, 0.75), 0.5),
    ("Black", (0.012, 0.012, 0.013), 0.35),
    ("Oxblood", (0.19, 0.016, 0.013), 0.36),
    ("Tan", (0.26, 0.10, 0.03), 0.4),
    ("Paper", (0.78, 0.72, 0.58), 0.8),
    ("Tin", (0.66, 0.60, 0.48), 0.38),
    ("Cream", (0.74, 0.66, 0.50), 0.25),
    ("Iron", (0.02, 0.021, 0.022), 0.5),
    ("Grout", (0.30, 0.27, 0.22), 0.9),
    ("Rubber", (0.018, 0.018, 0.018), 0.8),
    ("Terracotta", (0.42, 0.14, 0.06), 0.75),
    ("Soil", (0.035, 0.022, 0.014), 0.95),
    ("Dark glass", (0.012, 0.018, 0.024), 0.03),
]  # colour, roughness
METALS = [
    ("Chrome", (0.80, 0.80, 0.82), 0.08),
    ("Steel", (0.56, 0.56, 0.58), 0.25),
    ("Brass", (0.72, 0.47, 0.17), 0.2),
    ("Gilt", (0.75, 0.52, 0.20), 0.34),
    ("Mirror", (0.90, 0.92, 0.91), 0),
]
CLOTHS = [
    ("White towel", (0.76, 0.74, 0.70)),
    ("Red towel", (0.42, 0.035, 0.03)),
    ("Blue towel", (0.05, 0.13, 0.28)),
    ("Sand towel", (0.55, 0.42, 0.27)),
    ("Grey wool", (0.055, 0.05, 0.048)),
    ("Camel wool", (0.30, 0.17, 0.07)),
    ("Green wool", (0.03, 0.06, 0.035)),
    ("Rug red", (0.24, 0.022, 0.018)),
    ("Rug navy", (0.018, 0.026, 0.07)),
    ("Rug sand", (0.46, 0.33, 0.17)),
]
# The glass of bottles with cloudy lotion in them.
GLASSES = [
    ("Clear glass", (0.95, 0.96, 0.93)),
    ("Amber glass", (0.90, 0.52, 0.16)),
    ("Green glass", (0.30, 0.66, 0.38)),
    ("Blue glass", (0.25, 0.45, 0.90)),
    ("Yellow glass", (0.86, 0.80, 0.55)),
    ("Red glass", (0.80, 0.25, 0.22)),
]


def palette() -> None:
    """Every material of the shop. Colours are linear."""
    sheen = {"Roughness": 0.9, "Sheen_Weight": 0.3, "Specular_IOR_Level": 0.2}
    glass = {"Roughness": 0.0, "IOR": 1.45}
    plains(PAINTS)
    plains(METALS, Metallic=1.0)
    for name, color in CLOTHS:
        plain(name, color, **sheen)
    for name, color in GLASSES:
        plain(name, color, Transmission_Weight=0.65, **glass)
    plain("Disinfectant", (0.05, 0.35, 0.85), Transmission_Weight=1.0, **glass)
    pane("Pane", 0.12)
    for name, along in (("Mahogany", "Z"), ("Mahogany x", "X")):
        wood(name, (0.045, 0.013, 0.006), (0.16, 0.05, 0.02), 0.3, along)
    wood("Oak", (0.22, 0.11, 0.045), (0.42, 0.24, 0.11), 0.45)
    wood("Ebony", (0.012, 0.009, 0.007), (0.04, 0.028, 0.02), 0.3)
    marble(
        "Marble",
        [(0.3, 0.76, 0.74, 0.70), (0.5, 0.70, 0.68, 0.64), (0.56, 0.3, 0.29, 0.28)],
        3,
        0.12,
    )
    marble("Cream tile", [(0.3, 0.62, 0.56, 0.45), (0.7, 0.74, 0.69, 0.59)], 5, 0.16)
    marble("Black tile", [(0.35, 0.012, 0.012, 0.013), (0.75, 0.05, 0.046, 0.042)], 5, 0.14)
    marble("Plaster", [(0.3, 0.60, 0.50, 0.35), (0.7, 0.70, 0.60, 0.44)], 4, 0.8)
    marble("Brick", [(0.3, 0.26, 0.09, 0.05), (0.7, 0.40, 0.17, 0.10)], 3, 0.9)
    marble("Street stone", [(0.3, 0.22, 0.21, 0.20), (0.7, 0.34, 0.33, 0.31)], 2, 0.9)
    wallpaper("Wallpaper", (0.030, 0.085, 0.065), (0.15, 0.19, 0.10))
    plain("Porcelain", (0.82, 0.80, 0.76), Roughness=0.08, Coat_Weight=0.3)
    soft = {"Subsurface_Weight": 1.0, "Subsurface_Radius": (1.0, 0.6, 0.35)}
    plain("Soap", (0.80, 0.62, 0.42), Roughness=0.3, Subsurface_Scale=0.015, **soft)
    emissive("Opal globe", WARM, 3.0)
    emissive("Lamp tube", (1.0, 0.88, 0.72), 5.0)
    emissive("Bulb", WARM, 5.0)


def pane(name: str, reflection: float) -> None:
    """Thin glass that light passes straight through, as it does through two parallel faces."""
    graph = MaterialGraph(name)
    facing = graph.add("LayerWeight", {"Blend": reflection}).outputs["Fresnel"]
    clear = graph.add("BsdfTransparent", {"Color": (0.96, 0.98, 0.97)})
    mirror = graph.add("BsdfGlossy", {"Color": (1.0, 1.0, 1.0), "Roughness": 0.0})
    graph.finish(graph.mix_shaders(facing, clear, mirror))


def marble(name: str, stops: Points, scale: float, roughness: float) -> None:
    """Stone or plaster: a colour ramp of noise, another part of it in each piece of a mesh."""
    graph = MaterialGraph(name)
    color = graph.ramp(graph.noise(graph.shifted(), scale, 2.0), stops)
    graph.finish(graph.principled(Base_Color=color, Roughness=roughness))


def wallpaper(name: str, ground: Color, ink: Color) -> None:
    """An ogee damask of sine waves along the wall and up it."""
    graph = MaterialGraph(name)
    where = graph.xyz(graph.coordinates(*(2 * np.pi / 0.24,) * 3))
    a = graph.math("COSINE", graph.math("ADD", where["X"], where["Y"]))
    b = graph.math("COSINE", graph.math("MULTIPLY", where["Z"], 0.5))
    leaf = graph.math("COSINE", graph.math("MULTIPLY", graph.math("MULTIPLY", a, b), 9.0))
    ogee = graph.math("ABSOLUTE", graph.math("MULTIPLY_ADD", b, 1.4, a))
    leaf = graph.span(leaf, 0, 1, 0.3, 0.5)
    ogee = graph.span(ogee, 1, 0, 0.1, 0.2)
    color = graph.mix(graph.math("MAXIMUM", leaf, ogee), ground, ink)
    graph.finish(graph.principled(Base_Color=color, Roughness=0.6))
