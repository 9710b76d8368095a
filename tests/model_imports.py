"""Imports model files into the open scene, as scripts/import_model.py does."""

import numpy as np
import pytest

from lightfield.core.errors import UserError
from lightfield.stages.scene import ImportSettings


def imported(path, **settings):
    """Import a model into the open scene, and return its record."""
    # Blender has one global state, so it is not imported with the module.
    from lightfield.rendering.imports import model

    return model.make_scene(ImportSettings(model=str(path), **settings), path.parent)


def refusal(path, **settings):
    """Return the message with which the import of a model is refused."""
    with pytest.raises(UserError) as caught:
        imported(path, **settings)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and message.isprintable()
    return message


def seen(folder):
    """Return the open scene's base colour, linear, and alpha (8, 8, 4), seen from above.

    The camera sees x and y from 0.25 to 0.75. The colour is Cycles' own pass, which lacks the share
    of mirrored light, so surfaces mirror none. Row 0 is the top.
    """
    import bpy

    from lightfield.imaging.images import read_image
    from lightfield.rendering.scenes.quiet import quiet

    scene = bpy.context.scene
    for material in bpy.data.materials:
        for node in material.node_tree.nodes:
            if node.bl_idname == "ShaderNodeBsdfPrincipled":
                node.inputs["Specular IOR Level"].default_value = 0
    camera = bpy.data.cameras.new("above")
    camera.type = "ORTHO"
    camera.ortho_scale = 0.5
    scene.camera = bpy.data.objects.new("above", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.location = (0.5, 0.5, 2)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.render.film_transparent = True
    scene.view_layers[0].use_pass_diffuse_color = True
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.filepath = str(folder / "seen.exr")
    with quiet():
        bpy.ops.render.render(write_still=True)
    channels = read_image(folder / "seen.exr").channels
    endings = ("Diffuse Color.R", "Diffuse Color.G", "Diffuse Color.B", "Combined.A")
    names = [next(name for name in channels if name.endswith(end)) for end in endings]
    return np.stack([channels[name] for name in names], axis=2)
