"""The features of glTF, USD and FBX, what becomes of each, and a small file that has it.

test_scene_format_features.py imports each file. To write the tables of
docs/reference/scene-formats.md anew, run this file with PYTHONPATH=scripts:tests.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import test_fbx as fbx
import test_gltf_reader as gltf
import test_model_parts as parts
import test_usd_reader as usd

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "scene-formats.md"
BEGIN = "<!-- {} written by tests/rendering/scene_format_features.py. Change its rows instead. -->"
END = "<!-- end -->"


class Row(NamedTuple):
    """A feature, what becomes of it, a remark, and what writes a file that has it.

    The ``verdict`` is shown, noted, refused or not compared.
    """

    feature: str
    verdict: str
    remark: str
    write: Callable[[Path], Path]


# ---- glTF -----------------------------------------------------------------------------------


def document(**more: Any) -> Callable[[Path], Path]:
    return lambda folder: gltf.written(folder / "a.gltf", gltf.cube(**more))


def made(make: Callable[[], Any]) -> Callable[[Path], Path]:
    return lambda folder: gltf.written(folder / "a.gltf", make())


def material(extension: str, content: Any) -> Callable[[Path], Path]:
    """Return a writer of a cube with an extension of its material."""
    given = {"name": "m", "extensions": {extension: content}}
    return document(material=given, extensionsUsed=[extension])


def moved(path: str, values: Any, interpolation: str = "LINEAR") -> dict[str, Any]:
    made = gltf.cube()
    kind = "VEC4" if path == "rotation" else "VEC3"
    sampler = {
        "input": gltf.added(made, [0.0, 1.0], "SCALAR"),
        "output": gltf.added(made, values, kind),
        "interpolation": interpolation,
    }
    channel = {"sampler": 0, "target": {"node": 0, "path": path}}
    made["animations"] = [{"name": "a", "samplers": [sampler], "channels": [channel]}]
    return made


def instanced() -> dict[str, Any]:
    made = gltf.cube()
    places = gltf.added(made, [(0, 0, 0), (3, 0, 0)], "VEC3")
    extension = {"attributes": {"TRANSLATION": places}}
    made["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": extension}
    return made | {"extensionsUsed": ["EXT_mesh_gpu_instancing"]}


def morphed() -> dict[str, Any]:
    made = gltf.cube()
    target = gltf.added(made, np.tile((0.0, 1, 0), (8, 1)), "VEC3")
    made["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    made["meshes"][0]["weights"] = [0.5]
    return made


def skinned() -> dict[str, Any]:
    made = gltf.cube()
    attributes = made["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = gltf.added(made, np.zeros((8, 4), "<u2"), "VEC4", 5123)
    attributes["WEIGHTS_0"] = gltf.added(made, np.tile((1.0, 0, 0, 0), (8, 1)), "VEC4")
    made["skins"] = [{"joints": [1]}]
    made["nodes"] = [{"mesh": 0, "skin": 0}, {"translation": [1, 2, 3]}]
    return made | {"scenes": [{"nodes": [0, 1]}]}


def hidden() -> dict[str, Any]:
    visibility = {"KHR_node_visibility": {"visible": False}}
    return gltf.cube(
        nodes=[{"mesh": 0}, {"mesh": 0, "extensions": visibility}],
        scenes=[{"nodes": [0, 1]}],
        extensionsUsed=["KHR_node_visibility"],
    )


def pointed() -> dict[str, Any]:
    made = moved("translation", [(0, 0, 0), (1, 0, 0)])
    made["animations"][0]["channels"][0]["target"] = {
        "path": "pointer",
        "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0/translation"}},
    }
    return made | {"extensionsUsed": ["KHR_animation_pointer"]}


def two_animations() -> dict[str, Any]:
    made = moved("translation", [(0, 0, 0), (1, 0, 0)])
    return made | {"animations": made["animations"] * 2}


def variants() -> dict[str, Any]:
    named = {"KHR_materials_variants": {"variants": [{"name": "red"}, {"name": "blue"}]}}
    return gltf.cube(extensions=named, extensionsUsed=["KHR_materials_variants"])


SPLINE = np.tile((0.0, 0, 0), (6, 1))
GLTF = [
    Row(
        "nodes, also with a matrix that has a shear",
        "shown",
        "",
        document(nodes=[{"mesh": 0, "matrix": gltf.SHEAR}]),
    ),
    Row(
        "the scene, of several",
        "shown",
        "",
        document(
            scenes=[{"nodes": [0]}, {"nodes": [1]}],
            nodes=[{"mesh": 0}, {"mesh": 0, "scale": [9] * 3}],
        ),
    ),
    Row("skins", "shown", "", made(skinned)),
    Row(
        "a bone whose matrix has a shear",
        "refused",
        "",
        made(lambda: skinned() | {"nodes": [{"mesh": 0, "skin": 0}, {"matrix": gltf.SHEAR}]}),
    ),
    Row("morph targets", "shown", "", made(morphed)),
    Row("EXT_mesh_gpu_instancing", "shown", "", made(instanced)),
    Row(
        "animations: rotations far apart, steps, cubic splines",
        "shown",
        "frame 24 is 1 s after the begin",
        made(lambda: moved("translation", SPLINE, "CUBICSPLINE")),
    ),
    Row("animations after the first", "noted", "", made(two_animations)),
    Row("KHR_animation_pointer to nodes", "not compared", "Blender moves them", made(pointed)),
    Row("KHR_node_visibility", "refused", "if it hides a node", made(hidden)),
    Row(
        "KHR_draco_mesh_compression, EXT_meshopt_compression",
        "refused",
        "where Blender has no decoder; else not compared",
        made(lambda: parts.meshopt("EXT_meshopt_compression")),
    ),
    Row(
        "an extension in extensionsRequired that Blender does not know",
        "refused",
        "",
        document(extensionsUsed=["X_y"], extensionsRequired=["X_y"]),
    ),
    *(
        Row(name, "shown", remark, material(name, content))
        for name, content, remark in (
            ("KHR_materials_clearcoat", {"clearcoatFactor": 1}, ""),
            ("KHR_materials_sheen", {"sheenColorFactor": [1, 0, 0]}, ""),
            ("KHR_materials_transmission", {"transmissionFactor": 1}, ""),
            (
                "KHR_materials_volume",
                {"thicknessFactor": 1, "attenuationDistance": 2},
                "the attenuation distance follows the scale of `unit: box`",
            ),
            ("KHR_materials_unlit", {}, ""),
        )
    ),
    *(Row(name, "noted", "", material(name, gltf.IGNORED[name])) for name in gltf.IGNORED),
    Row("any other optional extension", "noted", "", document(extensionsUsed=["X_y"])),
    Row("KHR_materials_variants", "noted", "the default is shown", made(variants)),
]

# ---- USD ------------------------------------------------------------------------------------


def layer(*prims: str) -> Callable[[Path], Path]:
    return lambda folder: usd.written(folder, *prims)


MESH = usd.MESH
SHEAR = usd.placed("transform", usd.SHEAR)
RESET = usd.placed("translate", "(1, 0, 0)", '"!resetXformStack!", ')
TIMED = 'token visibility.timeSamples = {1: "invisible", 10: "inherited"}'
POINTS = (
    "int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (3, 0, 0)]\n"
    "rel prototypes = </p/a>"
)
GUIDE = 'uniform token purpose = "guide"'
USD = [
    Row(
        "references, payloads, sublayers, variants, value clips",
        "shown",
        "refused if one cannot be read",
        layer(usd.prim("Mesh", "a", MESH), usd.prim("Xform", "b", metadata="references = </a>")),
    ),
    Row(
        "instances, point instancers",
        "shown",
        "",
        layer(usd.prim("PointInstancer", "p", POINTS, usd.prim("Mesh", "a", MESH))),
    ),
    Row(
        "a mesh that is itself an instance",
        "refused",
        "",
        lambda folder: parts.written(folder / "a.usda", parts.usd(parts.LOST_SURFACES["instance"])),
    ),
    Row(
        "a transform with a shear",
        "shown",
        "refused above shapes that are no meshes, and if it moves",
        layer(usd.prim("Mesh", "a", SHEAR, MESH)),
    ),
    Row("`!resetXformStack!`", "shown", "", layer(usd.prim("Mesh", "a", RESET, MESH))),
    Row(
        "visibility and purpose",
        "shown",
        "guides and proxies are left out",
        layer(usd.prim("Mesh", "a", MESH), usd.prim("Mesh", "b", GUIDE, MESH)),
    ),
    Row(
        "visibility that changes with time",
        "refused",
        "if allowed, shown as at `frame`",
        layer(usd.prim("Mesh", "a", TIMED, MESH), usd.prim("Mesh", "b", MESH)),
    ),
    Row(
        "time samples, skeletons, blend shapes",
        "shown",
        "a frame is a time code",
        layer(
            usd.prim(
                "Mesh",
                "a",
                "double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 2: (1, 0, 0)}",
                'uniform token[] xformOpOrder = ["xformOp:translate"]',
                MESH,
            )
        ),
    ),
    Row(
        "Cube, Sphere, Cylinder, Cone, Capsule, Plane",
        "shown",
        "curves as flat faces",
        layer(usd.prim("Sphere", "a")),
    ),
    Row(
        "a material of such a shape",
        "refused",
        "",
        layer(
            usd.material("color3f inputs:diffuseColor = (1, 0, 0)").replace('Mesh "a"', 'Cube "a"')
        ),
    ),
    Row(
        "subdivision",
        "noted",
        "the cage is shown",
        layer(usd.prim("Mesh", "a", MESH, 'uniform token subdivisionScheme = "catmullClark"')),
    ),
    Row(
        "holes of a mesh",
        "refused",
        "",
        layer(usd.prim("Mesh", "a", MESH, "int[] holeIndices = [3]")),
    ),
    Row(
        "TetMesh, NurbsPatch, faces without corners",
        "refused",
        "",
        lambda folder: parts.written(folder / "a.usda", parts.usd(parts.LOST_SURFACES["TetMesh"])),
    ),
    Row(
        "UsdPreviewSurface, also through interfaces of materials and node graphs",
        "shown",
        "",
        layer(
            usd.material(
                "color3f inputs:diffuseColor.connect = </m.inputs:c>", interface=usd.INTERFACE
            )
        ),
    ),
    Row(
        "opacity, its threshold and its mode",
        "shown",
        "",
        layer(usd.material("float inputs:opacity = 0.4", "float inputs:opacityThreshold = 0.5")),
    ),
    Row("displacement", "noted", "", layer(usd.material("float inputs:displacement = 0.1"))),
    Row(
        "displayColor, displayOpacity, also inherited",
        "shown",
        "if there is no material",
        layer(usd.prim("Xform", "x", usd.RED + usd.CLEAR, usd.prim("Mesh", "a", MESH))),
    ),
    Row(
        "MaterialX and other shaders alone",
        "refused",
        "",
        lambda folder: parts.written(
            folder / "a.usda", parts.usd(parts.MATERIALX.replace("PREVIEW", ""))
        ),
    ),
]

# ---- FBX ------------------------------------------------------------------------------------


def tree(nodes: Any) -> Callable[[Path], Path]:
    return lambda folder: fbx.written(folder / "a.fbx", nodes, "bytes")


def nurbs() -> Any:
    nodes = fbx.triangle()
    nodes[2][2].append(("Geometry", [9, "n\0\1Geometry", "NurbsSurface"], []))
    return nodes


def two_stacks() -> Any:
    nodes = fbx.moving((0, 1), (0, 90))
    nodes[2][2].append(("AnimationStack", [11, "run\0\1AnimStack", ""], []))
    return nodes


FBX = [
    Row(
        "objects at rest: pivots, geometric transforms, axes, units",
        "shown",
        "",
        tree(fbx.triangle(model=fbx.PIVOT)),
    ),
    Row("skins and shapes at rest", "shown", "", tree(fbx.morphing(1))),
    Row("animation", "not compared", "Blender moves it", tree(fbx.moving((0, 1), (0, 90)))),
    Row("animations after the first", "noted", "", tree(two_stacks())),
    Row("several layers of an animation", "refused", "", tree(fbx.MISREAD["layers"][0])),
    Row("pivots between keys that lie apart", "refused", "", tree(fbx.MISREAD["pivot"][0])),
    Row("shapes between the ends of a channel", "refused", "", tree(fbx.MISREAD["in-between"][0])),
    Row("vertex caches", "refused", "", tree(fbx.MISREAD["vertex cache"][0])),
    Row("subdivision", "refused", "", tree(fbx.MISREAD["subdivision"][0])),
    Row("NURBS surfaces", "refused", "", tree(nurbs())),
    Row("a texture that is missing", "refused", "", tree(fbx.tree("/art/red.png", "red.png"))),
]

FORMATS = {"glTF": GLTF, "USD": USD, "FBX": FBX}


def table(rows: list[Row]) -> str:
    """Return rows as a table in Markdown."""
    lines = ["| feature | what becomes of it |", "| --- | --- |"]
    for row in rows:
        remark = f": {row.remark}" if row.remark else ""
        lines.append(f"| {row.feature} | {row.verdict}{remark} |")
    return "\n".join(lines)


def page(text: str) -> str:
    """Return the text of the page with the present tables."""
    for name, rows in FORMATS.items():
        before, _, rest = text.partition(BEGIN.format(name))
        _, _, after = rest.partition(END)
        text = f"{before}{BEGIN.format(name)}\n{table(rows)}\n{END}{after}"
    return text


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), "utf-8")
