"""What the still life is made of; colours are linear."""

import numpy as np

from scenes.library.materials import Color, MaterialGraph, emissive, foliage, plain, plains, wood

# Under the surface red light goes farthest: metres are these times the scale.
FLESH = {"Subsurface_Radius": (1.0, 0.5, 0.22)}


def palette() -> None:
    wood("Walnut", (0.035, 0.014, 0.006), (0.17, 0.075, 0.03), 0.22, along="X")
    wood("Ebony", (0.010, 0.007, 0.005), (0.035, 0.022, 0.014), 0.25)
    hammered("Copper", (0.93, 0.42, 0.25), 0.17)
    plains(
        [("Brass", (0.80, 0.53, 0.19), 0.16), ("Silver", (0.90, 0.89, 0.87), 0.09)], Metallic=1.0
    )
    clear("Glass", (0.975, 0.985, 0.98), 1.5)
    clear("Wine", (0.40, 0.012, 0.03), 1.34)
    linen("Linen", (0.74, 0.69, 0.60))
    linen("Blue linen", (0.035, 0.075, 0.19))
    plains(
        [("Porcelain", (0.84, 0.84, 0.82), 0.1), ("Cobalt", (0.012, 0.03, 0.22), 0.12)],
        Coat_Weight=0.5,
    )
    plains([("Eye", (0.004, 0.004, 0.005), 0.03)], Coat_Weight=1.0)
    plains(
        [("Wax", (0.90, 0.80, 0.62), 0.42)], Subsurface_Weight=1.0, Subsurface_Scale=0.02, **FLESH
    )
    pearl = {"Subsurface_Weight": 0.4, "Subsurface_Scale": 0.002, **FLESH}
    plain("Pearl", (0.84, 0.76, 0.69), Roughness=0.16, Coat_Weight=1.0, **pearl)
    emissive("Flame", (1.0, 0.56, 0.16), 14.0)
    plains(
        [
            ("Wick", (0.01, 0.008, 0.007), 0.9),
            ("Stalk", (0.10, 0.055, 0.02), 0.7),
            ("Beak", (0.80, 0.24, 0.03), 0.35),
            ("Skin", (0.75, 0.45, 0.08), 0.9),
        ]
    )
    foliage([("Leaf", (0.03, 0.085, 0.012), (0.09, 0.18, 0.03), 0.4)])
    for fruit in (pear, grape, lemon, lemon_flesh):
        graph = MaterialGraph(fruit.__name__.capitalize().replace("_", " "))
        flesh = {"Subsurface_Weight": 0.5, "Subsurface_Scale": 0.006, **FLESH}
        graph.finish(graph.principled(**fruit(graph), **flesh))
    down()


def clear(name: str, color: Color, ior: float) -> None:
    """Glass or wine that lamps shine through: their light would otherwise come as noise alone."""
    graph = MaterialGraph(name)
    body = graph.principled(Base_Color=color, IOR=ior, Roughness=0.0, Transmission_Weight=1.0)
    through = graph.add("BsdfTransparent", {"Color": color})
    to_a_lamp = graph.add("LightPath").outputs["Is Shadow Ray"]
    graph.finish(graph.mix_shaders(to_a_lamp, body, through))


def hammered(name: str, color: Color, roughness: float) -> None:
    """Metal with the shallow dents of a hammer."""
    graph = MaterialGraph(name)
    dents = graph.voronoi(graph.coordinates(), 95.0, "SMOOTH_F1")["Distance"]
    look = {"Metallic": 1.0, "Roughness": roughness, "Normal": graph.bump(dents, 0.0005)}
    graph.finish(graph.principled(Base_Color=color, **look))


def linen(name: str, color: Color) -> None:
    """Coarse cloth: threads of uneven thickness both ways, with a sheen."""
    graph = MaterialGraph(name)
    stretches = (1800.0, 60.0, 60.0), (60.0, 1800.0, 1800.0)
    threads = [graph.noise(graph.coordinates(*stretch), 1.0, 1.0) for stretch in stretches]
    weave = graph.math("ADD", *threads)
    tint = graph.ramp(weave, [(0.7, *(0.72 * c for c in color)), (1.0, *color)])
    look = {"Roughness": 0.9, "Sheen_Weight": 0.35, "Specular_IOR_Level": 0.2}
    graph.finish(graph.principled(Base_Color=tint, Normal=graph.bump(weave, 0.0006), **look))


def pear(graph: MaterialGraph) -> dict[str, object]:
    """A fruit's inputs besides those of flesh: green to yellow, with a blush and freckles."""
    where = graph.coordinates()
    side = graph.math("ADD", graph.xyz(where)["X"], graph.noise(where, 40.0))
    ground = graph.ramp(
        side, [(0.44, 0.38, 0.42, 0.05), (0.50, 0.62, 0.47, 0.06), (0.54, 0.55, 0.12, 0.03)]
    )
    freckles = graph.span(graph.voronoi(where, 330.0)["Distance"], 1.0, 0.0, 0.08, 0.2)
    color = graph.mix(graph.math("MULTIPLY", freckles, 0.6), ground, (0.20, 0.11, 0.03))
    return {"Base_Color": color, "Roughness": 0.32, "Normal": graph.bump(freckles, -0.0002)}


def grape(graph: MaterialGraph) -> dict[str, object]:
    """Dark skin, each of its own tint, with a pale bloom."""
    tint = graph.piece_tint((0.045, 0.006, 0.035), (0.16, 0.014, 0.03))
    bloom = graph.span(graph.noise(graph.coordinates(), 130.0), 0.0, 0.55, 0.45, 0.75)
    color = graph.mix(bloom, tint, (0.22, 0.19, 0.30))
    return {"Base_Color": color, "Roughness": graph.span(bloom, 0.16, 0.6, 0.0, 0.55)}


def lemon(graph: MaterialGraph) -> dict[str, object]:
    pores = graph.voronoi(graph.coordinates(), 620.0, "SMOOTH_F1")["Distance"]
    skin = {"Base_Color": (0.86, 0.56, 0.02), "Roughness": 0.36}
    return skin | {"Normal": graph.bump(pores, 0.0007)}


def lemon_flesh(graph: MaterialGraph) -> dict[str, object]:
    """The cut: ten segments within a white rind, around the object's Z."""
    where = graph.coordinates()
    axes = graph.xyz(where)
    turns = graph.math("ARCTAN2", axes["Y"], axes["X"])
    within = graph.math("PINGPONG", graph.math("MULTIPLY", turns, 5 / np.pi), 0.5)
    flat = graph.vector_math("MULTIPLY", where, (1.0, 1.0, 0.0))["Vector"]
    far = graph.vector_math("LENGTH", flat)["Value"]
    juice = graph.math("MULTIPLY", within, graph.math("MULTIPLY", far, 40.0))
    pulp = graph.noise(where, 300.0)
    flesh = graph.ramp(pulp, [(0.35, 0.78, 0.52, 0.03), (0.65, 0.90, 0.70, 0.16)])
    pith: Color = (0.86, 0.82, 0.62)
    color = graph.mix(graph.span(juice, 0.0, 1.0, 0.03, 0.06), pith, flesh)
    color = graph.mix(graph.span(far, 0.0, 1.0, 0.0235, 0.0245), color, pith)
    return {"Base_Color": color, "Roughness": 0.14, "Normal": graph.bump(pulp, 0.0006)}


def down() -> None:
    """Hair as a fibre of glass that is coloured inside."""
    graph = MaterialGraph("Down")
    along = graph.add("HairInfo").outputs["Intercept"]
    tint = graph.ramp(along, [(0, 0.72, 0.36, 0.05), (1, 0.95, 0.76, 0.30)])
    hair = {"Color": tint, "Roughness": 0.45, "Radial Roughness": 0.6}
    graph.finish(graph.add("BsdfHairPrincipled", hair, parametrization="COLOR"))
