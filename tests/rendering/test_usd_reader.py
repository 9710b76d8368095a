"""Models in USD: what the file says is what the scene holds, or it is refused or noted."""

import numpy as np
import pytest
from model_imports import imported, refusal

from lightfield.imaging.images import write_png

pytestmark = pytest.mark.slow

HEAD = '#usda 1.0\n(\nmetersPerUnit = 1\nupAxis = "Z"\n)\n'
# A tetrahedron from 0 to 1.
MESH = """int[] faceVertexCounts = [3, 3, 3, 3]
int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
"""
RED = 'color3f[] primvars:displayColor = [(1, 0, 0)] (\ninterpolation = "constant"\n)\n'
CLEAR = 'float[] primvars:displayOpacity = [0.25] (\ninterpolation = "constant"\n)\n'
SHEAR = "((1, 0, 0, 0), (1, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"


def prim(kind, name, *lines, metadata=""):
    head = f" (\n{metadata}\n)" if metadata else ""
    return f'def {kind} "{name}"{head} {{\n' + "\n".join(lines) + "\n}\n"


def placed(operation, value, reset=""):
    kind = {"transform": "matrix4d", "translate": "double3"}[operation]
    return (
        f"{kind} xformOp:{operation} = {value}\n"
        f'uniform token[] xformOpOrder = [{reset}"xformOp:{operation}"]\n'
    )


def material(*inputs, interface=()):
    shader = prim(
        "Shader",
        "s",
        'uniform token info:id = "UsdPreviewSurface"',
        *inputs,
        "token outputs:surface",
    )
    surface = "token outputs:surface.connect = </m/s.outputs:surface>"
    bound = prim(
        "Mesh",
        "a",
        MESH,
        "rel material:binding = </m>",
        metadata='prepend apiSchemas = ["MaterialBindingAPI"]',
    )
    return prim("Material", "m", *interface, surface, shader) + bound


def written(folder, *prims):
    path = folder / "a.usda"
    path.write_text(HEAD + "".join(prims))
    return path


def shader(name):
    import bpy

    (found,) = [
        node
        for node in bpy.data.materials[name].node_tree.nodes
        if node.bl_idname == "ShaderNodeBsdfPrincipled"
    ]
    return found


# ---- places ---------------------------------------------------------------------------------


@pytest.mark.parametrize("where", ["mesh", "above", "instance"])
def test_a_shear_is_shown(tmp_path, where):
    shear = placed("transform", SHEAR)
    if where == "mesh":
        prims = [prim("Mesh", "a", shear, MESH)]
    elif where == "above":
        prims = [prim("Xform", "x", shear, prim("Xform", "y", prim("Mesh", "a", MESH)))]
    else:
        body = prim("Xform", "y", prim("Mesh", "a", MESH))
        metadata = "instanceable = true\nreferences = </proto>"
        prims = [
            'class "proto" {\n' + body + "}\n",
            prim("Xform", "x", shear, metadata=metadata),
            prim("Xform", "z", placed("translate", "(0, 0, 1)"), metadata=metadata),
        ]
    record = imported(written(tmp_path, *prims), unit="metres")
    top = 2 if where == "instance" else 1
    # The tetrahedron's corner at y = 1 moves to x = 1.
    np.testing.assert_allclose(record["box"], [[0, 0, 0], [1, 1, top]], atol=1e-5)
    assert record["left_out"] == []


def test_a_shear_of_what_is_no_mesh_is_refused(tmp_path):
    shear = placed("transform", SHEAR)
    path = written(tmp_path, prim("Cube", "block", shear))
    assert "the mesh block: it reaches from (-2, -1, -1) to (2, 1, 1)" in refusal(path)


def test_a_place_without_the_parents_is_kept(tmp_path):
    inner = prim("Mesh", "a", placed("translate", "(1, 0, 0)", '"!resetXformStack!", '), MESH)
    path = written(tmp_path, prim("Xform", "x", placed("translate", "(7, 0, 0)"), inner))
    record = imported(path, unit="metres")
    np.testing.assert_allclose(record["box"], [[1, 0, 0], [2, 1, 1]], atol=1e-6)


def test_points_of_another_type_are_refused(tmp_path):
    path = written(
        tmp_path, prim("Mesh", "a", MESH.replace("point3f[] points", "int points = 3\n#"))
    )
    assert "the mesh a has points of another type than point3f[]" in refusal(path)


def test_holes_of_a_mesh_are_refused(tmp_path):
    path = written(tmp_path, prim("Mesh", "a", MESH, "int[] holeIndices = [3]"))
    assert "the mesh a: it has 3 triangles, of which Blender shows 4" in refusal(path)


# ---- what is shown when ---------------------------------------------------------------------


@pytest.mark.parametrize(("frame", "reach"), [(1, 1), (10, 7)])
def test_what_appears_with_time_is_refused_or_shown_as_at_the_frame(tmp_path, frame, reach):
    timed = 'token visibility.timeSamples = {1: "invisible", 10: "inherited"}'
    far = MESH.replace("(1, 0, 0)", "(7, 0, 0)")
    path = written(tmp_path, prim("Mesh", "a", timed, far), prim("Mesh", "b", MESH))
    assert "that a appears or vanishes with time" in refusal(path)
    record = imported(path, unit="metres", allow_missing=True, frame=frame)
    assert record["box"][1][0] == pytest.approx(reach)
    assert len(record["left_out"]) == 1


# ---- materials ------------------------------------------------------------------------------

INTERFACE = ["color3f inputs:c = (0.2, 0.4, 0.6)", "float inputs:r = 0.3"]


@pytest.mark.parametrize("way", ["material", "graph"])
def test_inputs_connected_to_the_materials_interface_have_its_values(tmp_path, way):
    graph = (
        'def NodeGraph "g" {\ncolor3f inputs:d.connect = </m.inputs:c>\n'
        "color3f outputs:e.connect = </m/g.inputs:d>\n}"
    )
    source = "</m.inputs:c>" if way == "material" else "</m/g.outputs:e>"
    inputs = [
        f"color3f inputs:diffuseColor.connect = {source}",
        "float inputs:roughness.connect = </m.inputs:r>",
    ]
    path = written(tmp_path, material(*inputs, interface=[*INTERFACE, graph]))
    assert imported(path)["left_out"] == []
    assert tuple(shader("m").inputs["Base Color"].default_value)[:3] == pytest.approx(
        (0.2, 0.4, 0.6)
    )
    assert shader("m").inputs["Roughness"].default_value == pytest.approx(0.3)


@pytest.mark.parametrize("way", ["material", "shader"])
def test_a_texture_named_by_the_materials_interface_is_shown(tmp_path, way):
    import bpy

    write_png(tmp_path / "b.png", np.full((2, 2, 3), 128, np.uint8))
    interface = ["asset inputs:f = @b.png@"]
    file = "inputs:file.connect = </m.inputs:f>" if way == "material" else "inputs:file = @b.png@"
    texture = prim(
        "Shader",
        "t",
        'uniform token info:id = "UsdUVTexture"',
        f"asset {file}",
        "float3 outputs:rgb",
    )
    inputs = ["color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>"]
    path = written(tmp_path, material(*inputs, interface=[*interface, texture]))
    assert imported(path)["left_out"] == []
    (link,) = shader("m").inputs["Base Color"].links
    assert link.from_node.image.filepath == "//b.png"
    assert sum(bool(image.packed_file) for image in bpy.data.images) == 1


def test_a_preview_surface_without_colour_has_the_colour_of_the_specification(tmp_path):
    imported(written(tmp_path, material("float inputs:roughness = 0.9")))
    assert tuple(shader("m").inputs["Base Color"].default_value)[:3] == pytest.approx((0.18,) * 3)


def test_an_opacity_that_means_presence_is_coverage_and_not_glass(tmp_path):
    inputs = ["float inputs:opacity = 0.4", 'token inputs:opacityMode = "presence"']
    assert imported(written(tmp_path, material(*inputs)))["left_out"] == []
    assert shader("m").inputs["Alpha"].default_value == pytest.approx(0.4)
    assert shader("m").inputs["Transmission Weight"].default_value == 0


@pytest.mark.parametrize(("opacity", "shown"), [(0.4, 0), (0.6, 1)])
def test_an_opacity_is_compared_with_its_threshold(tmp_path, opacity, shown):
    inputs = [f"float inputs:opacity = {opacity}", "float inputs:opacityThreshold = 0.5"]
    imported(written(tmp_path, material(*inputs)))
    assert shader("m").inputs["Alpha"].default_value == shown


# ---- colours without a material -------------------------------------------------------------


def attributes():
    """Return which attributes give the base colour and the opacity of the only material."""
    import bpy

    (only,) = bpy.data.materials
    return {
        link.to_socket.name: link.from_node.attribute_name
        for node in only.node_tree.nodes
        for entry in node.inputs
        for link in entry.links
        if link.from_node.bl_idname == "ShaderNodeAttribute"
    }


def values(attribute, field):
    import bpy

    (mesh,) = bpy.data.meshes
    return np.array([np.ravel(getattr(each, field)) for each in mesh.attributes[attribute].data])


@pytest.mark.parametrize("where", ["mesh", "above"])
def test_a_displayed_colour_and_opacity_are_shown(tmp_path, where):
    lines = [RED + CLEAR, MESH] if where == "mesh" else [MESH]
    mesh = prim("Mesh", "a", *lines)
    path = written(tmp_path, mesh if where == "mesh" else prim("Xform", "x", RED + CLEAR, mesh))
    assert imported(path)["left_out"] == []
    assert attributes() == {"Base Color": "displayColor", "Alpha": "displayOpacity"}
    np.testing.assert_allclose(values("displayColor", "color")[:, :3], np.tile((1, 0, 0), (12, 1)))
    np.testing.assert_allclose(values("displayOpacity", "value"), 0.25)


def test_the_subdivision_of_a_mesh_is_noted(tmp_path):
    scheme = 'uniform token subdivisionScheme = "catmullClark"'
    (noted,) = imported(written(tmp_path, prim("Mesh", "a", MESH, scheme)))["left_out"]
    assert noted == "the subdivision of the mesh a: its cage is shown"


def test_what_moves_still_moves_if_its_material_is_corrected(tmp_path):
    """The cache of the animation names the file itself, and not the copy that Blender has read."""
    import bpy

    moves = "double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 10: (10, 0, 0)}\n"
    moves += 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    bound = material("color3f inputs:diffuseColor.connect = </m.inputs:c>", interface=INTERFACE)
    path = written(tmp_path, bound.replace(MESH, moves + "\n" + MESH))
    record = imported(path, unit="metres", frame=7)
    np.testing.assert_allclose(record["box"], [[7, 0, 0], [8, 1, 1]], atol=1e-5)
    (cache,) = bpy.data.cache_files
    assert cache.filepath == "//a.usda"
