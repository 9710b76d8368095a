"""What the still life is made of; colours are linear."""

import bpy
import numpy as np

from scenes.library.materials import by_name, emissive, foliage, metal, plain, wood
from scenes.library.nodes import Color, MaterialGraph

# Under the surface red light goes farthest: metres are these times the scale.
FLESH = (1.0, 0.5, 0.22)


def palette() -> dict[str, bpy.types.Material]:
    wax = {"Subsurface_Weight": 1.0, "Subsurface_Radius": FLESH, "Subsurface_Scale": 0.02}
    pearl = {"Subsurface_Weight": 0.4, "Subsurface_Radius": FLESH, "Subsurface_Scale": 0.002}
    return by_name(
        [
            wood("Walnut", (0.035, 0.014, 0.006), (0.17, 0.075, 0.03), 0.22, along="X"),
            wood("Ebony", (0.010, 0.007, 0.005), (0.035, 0.022, 0.014), 0.25),
            hammered("Copper", (0.93, 0.42, 0.25), 0.17),
            metal("Brass", (0.80, 0.53, 0.19), 0.16),
            metal("Silver", (0.90, 0.89, 0.87), 0.09),
            clear("Glass", (0.975, 0.985, 0.98), 1.5),
            clear("Wine", (0.40, 0.012, 0.03), 1.34),
            linen("Linen", (0.74, 0.69, 0.60)),
            linen("Blue linen", (0.035, 0.075, 0.19)),
            plain("Porcelain", (0.84, 0.84, 0.82), Roughness=0.1, Coat_Weight=0.5),
            plain("Cobalt", (0.012, 0.03, 0.22), Roughness=0.12, Coat_Weight=0.5),
            plain("Wax", (0.90, 0.80, 0.62), Roughness=0.42, **wax),
            plain("Pearl", (0.84, 0.76, 0.69), Roughness=0.16, Coat_Weight=1.0, **pearl),
            emissive("Flame", (1.0, 0.56, 0.16), 14.0),
            plain("Wick", (0.01, 0.008, 0.007), Roughness=0.9),
            plain("Stalk", (0.10, 0.055, 0.02), Roughness=0.7),
            plain("Beak", (0.80, 0.24, 0.03), Roughness=0.35),
            plain("Eye", (0.004, 0.004, 0.005), Roughness=0.03, Coat_Weight=1.0),
            plain("Skin", (0.75, 0.45, 0.08), Roughness=0.9),
            foliage("Leaf", (0.03, 0.085, 0.012), (0.09, 0.18, 0.03)),
            pear(),
            grape(),
            lemon(),
            lemon_flesh(),
            down(),
        ]
    )


def clear(name: str, color: Color, ior: float) -> bpy.types.Material:
    """Glass or wine that lamps shine through: their light would otherwise come as noise alone."""
    graph = MaterialGraph(name)
    body = graph.principled(Base_Color=color, IOR=ior, Roughness=0.0, Transmission_Weight=1.0)
    through = graph.add("ShaderNodeBsdfTransparent", {"Color": color})
    to_a_lamp = graph.add("ShaderNodeLightPath").outputs["Is Shadow Ray"]
    return graph.finish(graph.mix_shaders(to_a_lamp, body, through))


def hammered(name: str, color: Color, roughness: float) -> bpy.types.Material:
    """Metal with the shallow dents of a hammer."""
    graph = MaterialGraph(name)
    dents = graph.voronoi(graph.coordinates(), 95.0, "SMOOTH_F1").outputs["Distance"]
    normal = graph.bump(dents, 0.0005)
    return graph.finish(
        graph.principled(Base_Color=color, Metallic=1.0, Roughness=roughness, Normal=normal)
    )


def linen(name: str, color: Color) -> bpy.types.Material:
    """Coarse cloth: threads of uneven thickness both ways, with a sheen."""
    graph = MaterialGraph(name)
    threads = [
        graph.noise(graph.coordinates(scale=stretch), 1.0, 1.0)
        for stretch in ((1800.0, 60.0, 60.0), (60.0, 1800.0, 1800.0))
    ]
    weave = graph.math("ADD", *threads)
    dark = tuple(0.72 * c for c in color)
    tint = graph.ramp(weave, [(0.7, *dark), (1.0, *color)])
    look = {"Roughness": 0.9, "Sheen_Weight": 0.35, "Specular_IOR_Level": 0.2}
    return graph.finish(graph.principled(Base_Color=tint, Normal=graph.bump(weave, 0.0006), **look))


def pear() -> bpy.types.Material:
    """Green to yellow, with a blush on one side and freckles."""
    graph = MaterialGraph("Pear")
    where = graph.coordinates()
    side = graph.math("ADD", graph.xyz(where)["X"], graph.noise(where, 40.0))
    ground = graph.ramp(side, "0.44 0.38 0.42 0.05, 0.50 0.62 0.47 0.06, 0.54 0.55 0.12 0.03")
    freckles = graph.span(graph.voronoi(where, 330.0).outputs["Distance"], 1.0, 0.0, 0.08, 0.2)
    color = graph.mix(graph.math("MULTIPLY", freckles, 0.6), ground, (0.20, 0.11, 0.03))
    return graph.finish(fruit_skin(graph, color, 0.32, graph.bump(freckles, -0.0002)))


def grape() -> bpy.types.Material:
    """Dark skin, each of its own tint, with a pale bloom."""
    graph = MaterialGraph("Grape")
    tint = graph.piece_tint((0.045, 0.006, 0.035), (0.16, 0.014, 0.03))
    bloom = graph.span(graph.noise(graph.coordinates(), 130.0), 0.0, 0.55, 0.45, 0.75)
    color = graph.mix(bloom, tint, (0.22, 0.19, 0.30))
    return graph.finish(fruit_skin(graph, color, graph.span(bloom, 0.16, 0.6, 0.0, 0.55)))


def lemon() -> bpy.types.Material:
    graph = MaterialGraph("Lemon")
    pores = graph.voronoi(graph.coordinates(), 620.0, "SMOOTH_F1").outputs["Distance"]
    return graph.finish(fruit_skin(graph, (0.86, 0.56, 0.02), 0.36, graph.bump(pores, 0.0007)))


def lemon_flesh() -> bpy.types.Material:
    """The cut: ten segments within a white rind, around the object's Z."""
    graph = MaterialGraph("Lemon flesh")
    where = graph.coordinates()
    axes = graph.xyz(where)
    turns = graph.math("ARCTAN2", axes["Y"], axes["X"])
    within = graph.math("PINGPONG", graph.math("MULTIPLY", turns, 5 / np.pi), 0.5)
    flat = graph.add("ShaderNodeVectorMath", {0: where, 1: (1.0, 1.0, 0.0)}, operation="MULTIPLY")
    far = graph.add("ShaderNodeVectorMath", {0: flat}, operation="LENGTH").outputs["Value"]
    juice = graph.math("MULTIPLY", within, graph.math("MULTIPLY", far, 40.0))
    pulp = graph.noise(where, 300.0)
    flesh = graph.ramp(pulp, "0.35 0.78 0.52 0.03, 0.65 0.90 0.70 0.16")
    pith: Color = (0.86, 0.82, 0.62)
    color = graph.mix(graph.span(juice, 0.0, 1.0, 0.03, 0.06), pith, flesh)
    color = graph.mix(graph.span(far, 0.0, 1.0, 0.0235, 0.0245), color, pith)
    return graph.finish(fruit_skin(graph, color, 0.14, graph.bump(pulp, 0.0006)))


def fruit_skin(
    graph: MaterialGraph, color: object, roughness: object, normal: object = None
) -> bpy.types.Node:
    """A shader under which light spreads some millimetres."""
    bent = {} if normal is None else {"Normal": normal}
    return graph.principled(
        Base_Color=color,
        Roughness=roughness,
        Subsurface_Weight=0.5,
        Subsurface_Radius=FLESH,
        Subsurface_Scale=0.006,
        **bent,
    )


def down() -> bpy.types.Material:
    """Hair as a fibre of glass that is coloured inside."""
    graph = MaterialGraph("Down")
    tint = graph.ramp(
        graph.add("ShaderNodeHairInfo").outputs["Intercept"],
        "0 0.72 0.36 0.05, 1 0.95 0.76 0.30",
    )
    hair = {"Color": tint, "Roughness": 0.45, "Radial Roughness": 0.6}
    return graph.finish(graph.add("ShaderNodeBsdfHairPrincipled", hair, parametrization="COLOR"))
