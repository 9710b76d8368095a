"""What the garden is made of; colours are linear."""

from scenes.library.materials import Color, MaterialGraph, foliage, plains, wood
from scenes.library.scene import animate

PAINTS = [
    ("Rope", (0.05, 0.04, 0.03), 0.9),
    ("Black lacquer", (0.015, 0.014, 0.013), 0.35),
    ("Candle cup", (0.10, 0.03, 0.02), 0.35),
    ("Wick", (0.01, 0.01, 0.01), 0.5),
    ("Shrub core", (0.012, 0.02, 0.006), 1),
]
LEAVES = [
    ("Azalea flowers", (0.55, 0.06, 0.20), (0.80, 0.30, 0.45), 0.3),
    ("Maple leaves", (0.30, 0.018, 0.010), (0.62, 0.13, 0.02), 0.5),
    ("Grass", (0.028, 0.062, 0.010), (0.125, 0.17, 0.032), 0.35),
    ("Green leaves", (0.03, 0.075, 0.014), (0.10, 0.17, 0.03), 0.4),
    ("Iris leaves", (0.04, 0.09, 0.02), (0.13, 0.20, 0.05), 0.3),
    ("Autumn leaves", (0.22, 0.09, 0.015), (0.40, 0.22, 0.03), 0.4),
    ("Lily petal", (0.72, 0.30, 0.42), (0.85, 0.62, 0.68), 0.3),
    ("Azalea leaves", (0.02, 0.055, 0.012), (0.07, 0.13, 0.025), 0.2),
    ("Lily pad", (0.035, 0.09, 0.02), (0.09, 0.17, 0.035), 0.1),
    ("Bamboo leaves", (0.05, 0.11, 0.018), (0.16, 0.22, 0.04), 0.4),
    ("Fallen maple leaves", (0.26, 0.02, 0.012), (0.55, 0.17, 0.04), 0.2),
    ("Pine needles", (0.012, 0.045, 0.016), (0.045, 0.095, 0.026), 0.15),
    ("Yellowing leaves", (0.07, 0.10, 0.015), (0.22, 0.22, 0.035), 0.4),
]
# Colour, and how far moss has come on what faces upwards, 0 … 1.
GRANITES = [
    ("Kerb granite", (0.23, 0.22, 0.20), 0.35),
    ("Plinth granite", (0.30, 0.29, 0.275), 0.15),
    ("Lantern granite", (0.25, 0.24, 0.225), 0.55),
    ("Rock", (0.17, 0.165, 0.155), 0.75),
]
PAPERS = [
    ("Pane paper", (0.86, 0.80, 0.66)),
    ("Cream globe paper", (0.88, 0.82, 0.68)),
    ("Red globe paper", (0.78, 0.12, 0.06)),
    ("Floor lantern paper", (0.88, 0.80, 0.64)),
]
BARKS = [
    ("Bark", (0.15, 0.12, 0.09)),
    ("Maple bark", (0.16, 0.13, 0.11)),
    ("Pine bark", (0.20, 0.13, 0.09)),
]
# Glowing gas: colour, and radiance a metre.
FLAMES = [
    ("Flame gas 0", (1, 0.2, 0.025), 6),
    ("Flame gas 1", (1, 0.34, 0.05), 7),
    ("Flame gas 2", (1, 0.52, 0.14), 12),
]


def palette() -> None:
    plains(PAINTS)
    plains([("Iron", (0.03, 0.028, 0.026), 0.55)], Metallic=0.8)
    plains(
        [("Polished brass", (0.75, 0.53, 0.22), 0.16), ("Mirror", (0.93, 0.94, 0.93), 0)],
        Metallic=1.0,
    )
    wood("Dark wood", (0.022, 0.012, 0.007), (0.14, 0.075, 0.038), 0.42)
    foliage(LEAVES)
    for name, tint, moss_part in GRANITES:
        granite(name, tint, moss_part)
    for name, tint in PAPERS:
        paper(name, tint)
    for name, tint in BARKS:
        bark(name, tint)
    for name, tint, glow in FLAMES:
        graph = MaterialGraph(name)
        graph.finish(volume=graph.add("Emission", {"Color": tint, "Strength": glow}))
    for each in NAMED:
        each(MaterialGraph(each.__name__.capitalize().replace("_", " ")))


def granite(name: str, tint: Color, moss: float) -> None:
    """Speckled granite; `moss` 0 … 1 is how far moss has come on what faces upwards."""
    graph = MaterialGraph(name)
    where = graph.coordinates()
    speckle = graph.noise(where, 90.0, 2.0, 0.8)
    broad = graph.noise(where, 3.0, 4.0, 0.6)
    dark, light = (tuple(factor * c for c in tint) for factor in (0.45, 1.5))
    stone = graph.ramp(speckle, [(0.36, *dark), (0.5, *tint), (0.66, *light)])
    stone = graph.mix(graph.span(broad, 0.0, 0.5, 0.35, 0.75), stone, (0.10, 0.095, 0.08))
    upwards = graph.xyz(graph.geometry("Normal"))["Z"]
    upwards = graph.math("ADD", upwards, graph.math("MULTIPLY", broad, 1.6))
    cover = graph.span(upwards, 0.0, 1.0, 2.05 - moss, 2.25 - moss)
    green = graph.ramp(speckle, [(0.3, 0.03, 0.05, 0.008), (0.7, 0.10, 0.13, 0.025)])
    color = graph.mix(cover, stone, green)
    roughness = graph.span(cover, 0.62, 0.95)
    normal = graph.bump(speckle, 0.003)
    surface = graph.principled(Base_Color=color, Roughness=roughness, Normal=normal)
    graph.finish(graph.plain_when_diffuse(surface, tint))


def paper(name: str, tint: Color) -> None:
    """Washi paper: half of the light that falls on it comes out at the other side."""
    graph = MaterialGraph(name)
    fibres = graph.noise(graph.coordinates(), 45.0, 4.0, 0.7, 1.0)
    thick = tuple(0.72 * c for c in tint)
    color = graph.mix(graph.span(fibres, 0.0, 0.35, 0.4, 0.7), tint, thick)
    graph.finish(graph.thin(color, 0.55))


def bark(name: str, tint: Color) -> None:
    """Cracked bark, with some green on it."""
    graph = MaterialGraph(name)
    cracks = graph.noise(graph.coordinates(7.0, 7.0, 1.6), 3.0, 5.0, 0.7, 0.6)
    dark = tuple(0.3 * c for c in tint)
    color = graph.ramp(cracks, [(0.35, *dark), (0.6, *tint), (0.75, 0.09, 0.11, 0.06)])
    graph.finish(graph.diffuse(color, Normal=graph.bump(cracks, 0.03)))


def moss(graph: MaterialGraph) -> None:
    where = graph.coordinates()
    fine = graph.noise(where, 28.0, 3.0, 0.7)
    broad = graph.math("MULTIPLY", graph.noise(where, 0.35, 3.0), 0.6)
    greens = [
        (0.30, 0.016, 0.032, 0.006),
        (0.48, 0.045, 0.085, 0.013),
        (0.62, 0.095, 0.120, 0.022),
        (0.75, 0.110, 0.085, 0.036),
    ]
    tint = graph.ramp(graph.math("MULTIPLY_ADD", fine, 0.4, broad), greens)
    surface = graph.diffuse(tint, Normal=graph.bump(fine, 0.03))
    graph.finish(graph.plain_when_diffuse(surface, (0.065, 0.085, 0.018)))


def gravel(graph: MaterialGraph) -> None:
    """Grains of four greys, dark between them."""
    grains = graph.voronoi(graph.coordinates(), 130.0)
    greys = [
        (0, 0.20, 0.185, 0.165),
        (0.4, 0.36, 0.345, 0.315),
        (0.8, 0.47, 0.45, 0.41),
        (1, 0.62, 0.60, 0.56),
    ]
    tint = graph.ramp(graph.xyz(grains["Color"])[0], greys)
    shade = graph.span(grains["Distance"], 1.0, 0.45, 0.25, 0.75)
    height = graph.math("SUBTRACT", 1.0, grains["Distance"])
    color = graph.mix(1.0, tint, shade, "MULTIPLY")
    surface = graph.diffuse(color, Normal=graph.bump(height, 0.006))
    graph.finish(graph.plain_when_diffuse(surface, (0.36, 0.34, 0.31)))


def wet_stone(graph: MaterialGraph) -> None:
    """Dark veined stone, a mirror where it is wet."""
    where = graph.coordinates()
    grain = graph.noise(where, 60.0, 2.0, 0.7)
    veins = graph.noise(where, 3.2, 5.0, 0.65, 0.8)
    wet = graph.span(graph.noise(where, 2.1, 2.0), 0.0, 1.0, 0.44, 0.56)
    dry = graph.ramp(
        veins, [(0.3, 0.075, 0.08, 0.085), (0.52, 0.13, 0.13, 0.125), (0.6, 0.2, 0.19, 0.17)]
    )
    color = graph.mix(wet, dry, graph.mix(1.0, dry, (0.42, 0.42, 0.45), "MULTIPLY"))
    roughness = graph.math("MULTIPLY_ADD", grain, 0.12, graph.span(wet, 0.34, 0.07))
    look = {"Roughness": roughness, "IOR": 1.6, "Normal": graph.bump(grain, 0.0012)}
    surface = graph.principled(Base_Color=color, **look)
    graph.finish(graph.plain_when_diffuse(surface, (0.09, 0.09, 0.09)))


def mountain(graph: MaterialGraph) -> None:
    """Forest, rock where it is steep, snow on the tops."""
    where = graph.coordinates()
    forest = graph.noise(where, 0.16, 6.0, 0.75)
    flat = graph.xyz(graph.geometry("Normal"))["Z"]
    level = graph.math("MULTIPLY_ADD", forest, 0.5, flat)
    greens = [(0.35, 0.020, 0.045, 0.026), (0.52, 0.045, 0.075, 0.030), (0.68, 0.12, 0.10, 0.04)]
    trees = graph.ramp(forest, greens)
    color = graph.mix(graph.span(level, 0.0, 1.0, 0.75, 1.0), (0.16, 0.16, 0.17), trees)
    high = graph.math("MULTIPLY_ADD", forest, 30.0, graph.xyz(where)["Z"])
    color = graph.mix(graph.span(high, 0.0, 1.0, 132.0, 146.0), color, (0.75, 0.78, 0.82))
    graph.finish(graph.diffuse(color))


def fog(graph: MaterialGraph) -> None:
    """Fog that glows with the light it would scatter to the viewer: no noise, hardly any cost."""
    density = 0.012  # part of the light lost a metre
    veil = graph.add("VolumeAbsorption", {"Color": (0.0, 0.0, 0.0), "Density": density})
    glow = graph.add("Emission", {"Color": (0.62, 0.60, 0.62), "Strength": density})
    graph.finish(volume=graph.add("AddShader", {0: veil, 1: glow}))


def rough_bronze(graph: MaterialGraph) -> None:
    """Rough metal: worn bronze with patina, brushed in changing directions."""
    where = graph.coordinates()
    broad = graph.noise(where, 2.6, 5.0, 0.6)
    fine = graph.noise(where, 26.0, 5.0, 0.7)
    brushed = graph.noise(graph.coordinates(4.0, 4.0, 160.0), 1.0, 2.0)
    patina = graph.span(graph.math("MULTIPLY_ADD", fine, 0.5, broad), 0.0, 1.0, 0.72, 0.95)
    metal_tint = graph.ramp(fine, [(0.3, 0.36, 0.20, 0.09), (0.7, 0.62, 0.40, 0.19)])
    worn = graph.math("MULTIPLY_ADD", fine, 0.16, graph.span(broad, 0.16, 0.46, 0.3, 0.7))
    surface = graph.principled(
        Base_Color=graph.mix(patina, metal_tint, (0.10, 0.19, 0.16)),
        Metallic=graph.span(patina, 1.0, 0.15),
        Roughness=graph.math("MULTIPLY_ADD", patina, 0.3, worn),
        Anisotropic=0.6,
        Anisotropic_Rotation=graph.noise(where, 1.3, 2.0),
        Normal=graph.bump(graph.math("MULTIPLY_ADD", brushed, 0.25, fine), 0.003),
    )
    graph.finish(surface)


def vermilion(graph: MaterialGraph) -> None:
    """Weathered red paint."""
    worn = graph.noise(graph.coordinates(3.0, 3.0, 0.6), 2.0, 5.0, 0.7)
    tint = graph.ramp(
        worn, [(0.35, 0.20, 0.028, 0.010), (0.6, 0.46, 0.060, 0.018), (0.75, 0.52, 0.10, 0.04)]
    )
    normal = graph.bump(worn, 0.004)
    graph.finish(graph.principled(Base_Color=tint, Roughness=0.45, Normal=normal))


def water(graph: MaterialGraph) -> None:
    """Clear water, whose ripples run on with the frames; light passes straight into it."""
    drift = graph.coordinates(1.0, 1.6, 1.0)
    animate(drift.node.inputs["Location"], "default_value", 0.012, 0)
    ripples = graph.noise(drift, 5.0, 3.0, 0.55, 0.0, 0.0, noise_dimensions="4D")
    animate(ripples.node.inputs["W"], "default_value", 0.04)
    normal = graph.bump(ripples, 0.045)
    reflected = graph.add("Fresnel", {"IOR": 1.33, "Normal": normal})
    clear = graph.add("BsdfTransparent", {"Color": (0.62, 0.74, 0.66)})
    gloss = {"Color": (1.0, 1.0, 1.0), "Roughness": 0.02, "Normal": normal}
    graph.finish(graph.mix_shaders(reflected, clear, graph.add("BsdfAnisotropic", gloss)))


def koi(graph: MaterialGraph) -> None:
    """White, with patches of orange, red and black that differ from fish to fish."""
    patches = graph.noise(graph.coordinates(), 5.0, 2.0)
    patches = graph.math("MULTIPLY_ADD", graph.object_random(), 0.22, patches)
    stops = [
        (0.50, 0.85, 0.80, 0.72),
        (0.56, 0.90, 0.22, 0.03),
        (0.72, 0.80, 0.10, 0.02),
        (0.76, 0.03, 0.03, 0.03),
    ]
    graph.finish(graph.principled(Base_Color=graph.ramp(patches, stops), Roughness=0.3))


def bamboo_culm(graph: MaterialGraph) -> None:
    """Green or yellow by culm, paler in long streaks."""
    along = graph.noise(graph.coordinates(6.0, 6.0, 0.8), 1.0, 4.0)
    tint = graph.mix(graph.object_random(), (0.10, 0.16, 0.035), (0.24, 0.23, 0.06))
    tint = graph.mix(graph.span(along, 0.0, 0.6, 0.4, 0.7), tint, (0.26, 0.22, 0.10))
    graph.finish(graph.principled(Base_Color=tint, Roughness=0.35))


def embers(graph: MaterialGraph) -> None:
    """Charred wood that glows in patches."""
    heat = graph.span(graph.noise(graph.coordinates(), 14.0, 4.0, 0.7), 0.0, 1.0, 0.48, 0.66)
    color = graph.mix(heat, (0.015, 0.013, 0.012), (0.10, 0.09, 0.085))
    strength = graph.math("MULTIPLY", heat, 5.0)
    glow = {"Emission_Color": (1.0, 0.16, 0.02), "Emission_Strength": strength}
    graph.finish(graph.principled(Base_Color=color, Roughness=0.9, **glow), is_lamp=False)


def wax(graph: MaterialGraph) -> None:
    """Wax that glows faintly where the flame shines into it."""
    warm = graph.span(graph.xyz(graph.coordinates())["Z"], 0.0, 0.9, 0.06, 0.2)
    strength = graph.math("MULTIPLY", warm, warm)
    glow = {"Emission_Color": (1.0, 0.36, 0.10), "Emission_Strength": strength}
    wax = graph.principled(Base_Color=(0.82, 0.72, 0.55), Roughness=0.45, **glow)
    graph.finish(wax, is_lamp=False)


def candle_flame(graph: MaterialGraph) -> None:
    """A flame, blue at its foot; the lamps beside the candles give its light."""
    height = graph.span(graph.xyz(graph.coordinates())["Z"], 0.0, 1.0, 0.2, 0.252)
    tint = graph.ramp(
        height, [(0, 0.15, 0.2, 0.8), (0.2, 1, 0.45, 0.12), (0.6, 1, 0.72, 0.32), (1, 1, 0.4, 0.08)]
    )
    graph.finish(graph.add("Emission", {"Color": tint, "Strength": 9.0}), is_lamp=False)


# Materials that are named as their functions.
NAMED = (moss, gravel, wet_stone, mountain, fog, rough_bronze, vermilion, water, koi, bamboo_culm)
NAMED += (embers, wax, candle_flame)
