"""Scenes in which something follows the camera, each by another mechanism of Blender.

Each function adds a white card, or several, to the open studio of `blend_scenes`.
"""

import itertools
import math
import tempfile
from pathlib import Path


def card(name, location):
    """Add a card without thickness, which faces up."""
    import bpy

    bpy.ops.mesh.primitive_plane_add(size=0.9, location=location)
    placed = bpy.context.object
    placed.name = name
    return placed


def track_to():
    constraint = card("Billboard", (0.3, -1.2, 0.3)).constraints.new("TRACK_TO")
    constraint.target = _camera()
    constraint.track_axis, constraint.up_axis = "TRACK_Z", "UP_Y"


def through_an_empty():
    """Let a card follow an empty that follows the camera."""
    import bpy

    empty = bpy.data.objects.new("Middle", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.constraints.new("COPY_ROTATION").target = _camera()
    card("Sign", (0.3, -1.2, 0.3)).constraints.new("COPY_ROTATION").target = empty


def parent():
    held = card("Visor", (0.3, 0.1, -1.5))
    held.parent = _camera()


def lamp():
    """Let a lamp be on the camera, as a flash."""
    import bpy

    light = bpy.data.lights.new("Flash", "POINT")
    light.energy = 100
    flash = bpy.data.objects.new("Flash", light)
    bpy.context.scene.collection.objects.link(flash)
    flash.parent = _camera()
    flash.location = (0.5, 0, 0)


def driver():
    """Let a card move with the camera's place."""
    _drive(card("Driven", (0.3, -1.2, 0.3)), "OBJECT", _camera(), "location.x")


def driven_material():
    """Let the colour of a material follow the camera."""
    import bpy

    colour = bpy.data.materials["Red"].node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    _drive(colour, "OBJECT", _camera(), "location.x", "default_value", add=0.1)


def driver_of_the_scene():
    """Let a card move with the scene's active camera."""
    import bpy

    placed = card("Driven", (0.3, -1.2, 0.3))
    _drive(placed, "SCENE", bpy.context.scene, "camera.location.x")


def driver_of_the_context():
    target = _drive(card("Driven", (0.3, -1.2, 0.3)), None, None, "camera.location.x")
    target.id_data.update_tag()


def active_camera():
    """Let geometry nodes turn a card to the active camera."""
    nodes = _nodes(card("Turned", (0.3, -1.2, 0.3)))
    tree, info = nodes
    turn = tree.nodes.new("GeometryNodeTransform")
    _through(tree, turn)
    tree.links.new(info.outputs["Rotation"], turn.inputs["Rotation"])


def culled():
    """Let geometry nodes leave out what is far from the active camera's place across."""
    import bpy

    placed = card("Culled", (0.3, -1.2, 0.3))
    tree, info = _nodes(placed)
    delete = tree.nodes.new("GeometryNodeDeleteGeometry")
    beyond = tree.nodes.new("FunctionNodeCompare")
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(info.outputs["Location"], split.inputs[0])
    tree.links.new(split.outputs["X"], beyond.inputs[0])
    beyond.operation = "GREATER_THAN"
    beyond.inputs[1].default_value = 0.2
    tree.links.new(beyond.outputs[0], delete.inputs["Selection"])
    _through(tree, delete)
    assert bpy.context.scene.camera


def muted():
    """Let one card turn to the active camera, and mute the link by which another one would."""
    active_camera()
    tree, info = _nodes(card("Still", (-0.9, -1.4, 0.4)))
    (link,) = info.inputs["Object"].links
    link.is_muted = True
    turn = tree.nodes.new("GeometryNodeTransform")
    _through(tree, turn)
    tree.links.new(info.outputs["Rotation"], turn.inputs["Rotation"])


def follow_track():
    """Let a card be where the active camera sees a tracked feature of a film."""
    constraint, clip = _of_film("FOLLOW_TRACK")
    track = clip.tracking.tracks.new(name="Feature", frame=1)
    track.markers[0].co = (0.55, 0.6)
    constraint.track = "Feature"


def object_solver():
    """Let a card move with an object that Blender has found in a film of the active camera."""
    import bpy

    constraint, clip = _of_film("OBJECT_SOLVER")
    # It faces the camera there.
    constraint.id_data.location = (0.2, -0.1, -3)
    thing = clip.tracking.objects.new("Thing")
    thing.keyframe_a, thing.keyframe_b = 1, 3
    clip.tracking.objects.active = thing
    constraint.object = "Thing"
    # Blender gives the scene's camera the film's lens.
    lens = _camera().data
    film_camera = clip.tracking.camera
    film_camera.sensor_width, film_camera.focal_length = lens.sensor_width, lens.lens
    focal = lens.lens / lens.sensor_width
    places = itertools.product((-1, 0.1, 0.9), (-0.8, 1), (-1, 0.7))
    for number, (x, y, z) in enumerate(places):
        track = thing.tracks.new(name=str(number), frame=1)
        for frame, turn in ((1, 0), (2, 0.25), (3, 0.5)):
            across = x * math.cos(turn) + z * math.sin(turn) + turn
            depth = 8 + x * math.sin(turn) - z * math.cos(turn)
            # In parts of the film's width and height.
            seen = (0.5 + focal * across / depth, 0.5 + focal * y / depth * 64 / 48)
            if frame == 1:
                track.markers[0].co = seen
            else:
                track.markers.insert_frame(frame, co=seen)
    (window, *_) = bpy.context.window_manager.windows
    (area, *_) = window.screen.areas
    area.type = "CLIP_EDITOR"
    area.spaces.active.clip = clip
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.clip.solve_camera()
    assert thing.reconstruction.is_valid


def line_art():
    """Draw the outlines that the active camera sees."""
    import bpy

    drawing = bpy.data.grease_pencils.new("Lines")
    lines = bpy.data.objects.new("Lines", drawing)
    bpy.context.scene.collection.objects.link(lines)
    drawing.layers.new("Ink").frames.new(1)
    ink = bpy.data.materials.new("Ink")
    bpy.data.materials.create_gpencil_data(ink)
    drawing.materials.append(ink)
    outline = lines.modifiers.new("outline", "LINEART")
    outline.target_layer = "Ink"
    outline.target_material = ink


def named_by_nodes():
    """Let geometry nodes turn a card to the camera that their modifier names."""
    tree, info = _nodes(card("Named", (0.3, -1.2, 0.3)))
    for link in list(info.inputs["Object"].links):
        tree.links.remove(link)
    info.inputs["Object"].default_value = _camera()
    turn = tree.nodes.new("GeometryNodeTransform")
    _through(tree, turn)
    tree.links.new(info.outputs["Rotation"], turn.inputs["Rotation"])


def diced_for_the_view():
    """Let Cycles divide a rough wall into pieces of a few pixels of the active camera."""
    import bpy

    wall = card("Wall", (0, 1.5, 0.5))
    wall.scale = (6, 2, 1)
    wall.rotation_euler = (1.4, 0, 0)
    divide = wall.modifiers.new("divide", "SUBSURF")
    divide.subdivision_type = "SIMPLE"
    divide.use_adaptive_subdivision = True
    divide.adaptive_pixel_size = 6
    rough = bpy.data.materials.new("Rough")
    rough.displacement_method = "DISPLACEMENT"
    tree = rough.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 6
    height = tree.nodes.new("ShaderNodeDisplacement")
    tree.links.new(noise.outputs[0], height.inputs["Height"])
    tree.links.new(height.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    wall.data.materials.append(rough)


def diced_for_another_camera():
    """Let Cycles divide the wall for a camera that is far away."""
    import bpy

    diced_for_the_view()
    scene = bpy.context.scene
    dicing = scene.cycles.dicing_camera = bpy.data.objects.new("Dicing", _camera().data)
    dicing.location = (0, -60, 1)
    dicing.rotation_euler = (1.57, 0, 0)
    scene.collection.objects.link(dicing)


def _camera():
    import bpy

    return bpy.context.scene.camera


def _drive(owner, id_type, block, path, driven="location", add=0.6):
    """Drive the first element of a vector by a property. Return the driver's target."""
    driver = owner.driver_add(driven, 0).driver
    driver.type = "SCRIPTED"
    variable = driver.variables.new()
    variable.name = "value"
    target = variable.targets[0]
    if id_type:
        target.id_type = id_type
        target.id = block
    else:
        variable.type = "CONTEXT_PROP"
    target.data_path = path
    driver.expression = f"value + {add}"
    return target


def _of_film(kind):
    """Give a card a constraint of a kind that follows a film. Return both."""
    import bpy

    placed = card("Tracked", (0.3, -1.2, 0.3))
    frame = bpy.data.images.new("film", 64, 48)
    frame.filepath_raw = str(Path(tempfile.mkdtemp()) / "film0001.png")
    frame.file_format = "PNG"
    frame.save()
    constraint = placed.constraints.new(kind)
    constraint.use_active_clip = False
    constraint.clip = bpy.data.movieclips.load(frame.filepath_raw)
    return constraint, constraint.clip


def _nodes(obj):
    """Give an object geometry nodes. Return the tree, and a node with the active camera's place."""
    import bpy

    tree = bpy.data.node_groups.new(obj.name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Mesh", in_out=direction, socket_type="NodeSocketGeometry")
    obj.modifiers.new("nodes", "NODES").node_group = tree
    info = tree.nodes.new("GeometryNodeObjectInfo")
    tree.links.new(
        tree.nodes.new("GeometryNodeInputActiveCamera").outputs[0], info.inputs["Object"]
    )
    return tree, info


def _through(tree, node):
    """Lead the object's mesh through a node."""
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], node.inputs["Geometry"])
    tree.links.new(node.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
