"""Finds holdouts: surfaces that a picture shows as holes, and that hide what is behind them."""

import bpy

from lightfield.rendering.setup.cycles import view_layer


def exist() -> bool:
    """Return whether the open scene may have a holdout: an object, a collection or a material."""
    layer = view_layer(bpy.context.scene)
    if any(obj.holdout_get(view_layer=layer) for obj in layer.objects):
        return True
    trees = [*bpy.data.node_groups, *(each.node_tree for each in bpy.data.materials)]
    nodes = (node for tree in filter(None, trees) for node in tree.nodes)
    return any(node.bl_idname == "ShaderNodeHoldout" for node in nodes)
