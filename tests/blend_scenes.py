"""Small .blend scenes in which a setting of the file can change the picture.

tests/blend_settings.py says what becomes of each setting. Each function here adds to the open scene
what a setting needs. `roots` returns the owners of settings by short names.
"""

SIZE = (64, 48)
SAMPLES = 4


def studio():
    """Make the scene of all cases: a ground, three bodies, two lamps, a sky, and a camera.

    The file's settings are those of the scene YAML, so that the tested one alone differs.
    """
    import bpy

    from lightfield.dataset.keys import view_seed
    from lightfield.rendering import blend_file

    blend_file.new_scene()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = SAMPLES
    scene.cycles.seed = view_seed(0, "view_0001f")
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    things = bpy.data.collections.new("Things")
    scene.collection.children.link(things)
    _world(scene)
    _put(things, "Ground", _plane("Ground", 4), location=(0, 0, -0.5))
    cube = _put(things, "Cube", _box("Cube"), location=(-0.5, 0, 0))
    cube.data.materials.append(_material("Red", (0.8, 0.1, 0.05, 1)))
    ball = _put(things, "Ball", _sphere("Ball", 0.5), location=(0.8, -0.3, 0))
    ball.data.materials.append(_material("Glass", (1, 1, 1, 1), transmission=1))
    bpy.data.objects["Ground"].data.materials.append(_material("Grey", (0.5, 0.5, 0.5, 1)))
    chrome = _put(things, "Chrome", _sphere("Chrome", 0.5), location=(-1.6, 0.8, 0))
    chrome.data.materials.append(_material("Chrome", (0.9, 0.9, 0.9, 1), metallic=1))
    lamp = bpy.data.lights.new("Lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 150, 0.2
    _put(scene.collection, "Lamp", lamp, location=(1.5, -2, 2.5))
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = 1
    _put(scene.collection, "Sun", sun, rotation=(0.6, 0.2, 0))
    camera = _put(
        scene.collection,
        "Camera",
        bpy.data.cameras.new("Camera"),
        location=(0, -5, 1.2),
        rotation=(1.35, 0, 0),
    )
    scene.camera = camera


def moving_cube():
    """Let the cube cross half a metre a frame. It is in its place at frame 1."""
    import bpy

    studio()
    cube = bpy.data.objects["Cube"]
    for frame, x in ((-9, -5.5), (11, 4.5)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    _make_linear(cube)
    bpy.context.scene.frame_set(1)


def blurred_cube():
    """Blur the moving cube."""
    import bpy

    moving_cube()
    bpy.context.scene.render.use_motion_blur = True


def transparent_film():
    """Leave out the sky behind the scene."""
    import bpy

    bpy.context.scene.render.film_transparent = True


def shaded_ground():
    """Let a board above the view shade the ground."""
    import bpy

    studio()
    board = _put(bpy.context.scene.collection, "Board", _plane("Board", 1), location=(0, 0, 4))
    board.rotation_euler.x = 0.3
    bpy.data.lights["Sun"].energy = 5


def cull_by_the_camera():
    """Leave out what the camera does not see, also its shadow."""
    _cull("camera")


def cull_by_distance():
    """Leave out what is far from the camera."""
    import bpy

    _cull("distance")
    bpy.context.scene.cycles.distance_cull_margin = 1


def _cull(kind):
    import bpy

    scene = bpy.context.scene
    scene.render.use_simplify = True
    setattr(scene.cycles, f"use_{kind}_cull", True)
    setattr(bpy.data.objects["Board"].cycles, f"use_{kind}_cull", True)


def scaled_camera():
    """Roll the camera, and scale it along its own axes, which changes no picture."""
    import bpy

    camera = bpy.context.scene.camera
    camera.rotation_euler.y = 0.4
    camera.scale = (3, 2, 0.5)


def parent_of_one_scale():
    """Let a parent scale the camera evenly, and so take it to another place."""
    _parent((1.3, 1.3, 1.3))


def mirrored_camera():
    """Mirror the camera along its own x."""
    import bpy

    bpy.context.scene.camera.scale.x = -1


def mirroring_parent():
    """Let a parent mirror the camera in the plane x = 0."""
    _parent((-1, 1, 1))


def turning_twice():
    """Mirror the camera along two axes, which is half a turn, and no mirror."""
    import bpy

    bpy.context.scene.camera.scale = (-1, -1, 1)


def shearing_parent():
    """Let a parent of two scales shear a rolled camera."""
    import bpy

    bpy.context.scene.camera.rotation_euler.y = 0.8
    _parent((2, 1, 1))


def flat_camera():
    """Let the camera have no width."""
    import bpy

    bpy.context.scene.camera.scale.x = 0


def _parent(scale):
    import bpy

    scene = bpy.context.scene
    parent = _put(scene.collection, "Parent", None)
    parent.scale = scale
    scene.camera.parent = parent


def roots(scene):
    """Return the owners of settings, by short names."""
    import bpy

    layer = scene.view_layers[0]
    camera = scene.camera
    return {
        "scene": scene,
        "render": scene.render,
        "cycles": scene.cycles,
        "curves": scene.cycles_curves,
        "view": scene.view_settings,
        "units": scene.unit_settings,
        "layer": layer,
        "layer_cycles": layer.cycles,
        "layer_collection": layer.layer_collection.children["Things"],
        "collection": bpy.data.collections["Things"],
        "camera": camera.data,
        "focus": camera.data.dof,
        "stereo": camera.data.stereo,
        "world": scene.world,
        "world_cycles": scene.world.cycles,
        "world_visibility": scene.world.cycles_visibility,
        "cube": bpy.data.objects["Cube"],
        "ground": bpy.data.objects["Ground"],
        "cube_cycles": bpy.data.objects["Cube"].cycles,
        "lamp": bpy.data.lights["Lamp"],
        "lamp_cycles": bpy.data.lights["Lamp"].cycles,
        "lamp_object": bpy.data.objects["Lamp"],
        "material": bpy.data.materials["Red"],
        "material_cycles": bpy.data.materials["Red"].cycles,
    }


def _put(collection, name, data, location=(0, 0, 0), rotation=(0, 0, 0)):
    import bpy

    placed = bpy.data.objects.new(name, data)
    placed.location, placed.rotation_euler = location, rotation
    collection.objects.link(placed)
    return placed


def _mesh(name, build):
    import bmesh
    import bpy

    shape = bmesh.new()
    build(shape)
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    return mesh


def _box(name):
    import bmesh

    return _mesh(name, lambda shape: bmesh.ops.create_cube(shape, size=1))


def _plane(name, half):
    import bmesh

    return _mesh(name, lambda shape: bmesh.ops.create_grid(shape, size=half))


def _sphere(name, radius):
    import bmesh

    def build(shape):
        bmesh.ops.create_uvsphere(shape, u_segments=16, v_segments=8, radius=radius)

    return _mesh(name, build)


def _material(name, colour, metallic=0, transmission=0):
    import bpy

    material = bpy.data.materials.new(name)
    shader = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = colour
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Transmission Weight"].default_value = transmission
    shader.inputs["Roughness"].default_value = 0.1 if metallic or transmission else 0.5
    return material


def _world(scene):
    import bpy

    world = scene.world = bpy.data.worlds.new("Sky")
    nodes = world.node_tree.nodes
    background = next((n for n in nodes if n.bl_idname == "ShaderNodeBackground"), None)
    if background is None:
        background = nodes.new("ShaderNodeBackground")
        output = nodes.new("ShaderNodeOutputWorld")
        world.node_tree.links.new(background.outputs[0], output.inputs[0])
    background.inputs[0].default_value = (0.2, 0.3, 0.6, 1)


def _make_linear(block):
    from lightfield.rendering import animation

    for curve in animation.curves(block):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def go_between_frames():
    """Save the file at frame 1.5."""
    import bpy

    bpy.context.scene.frame_set(1, subframe=0.5)


def move_the_camera():
    """Let the camera travel 0.3 m to its right while the shutter is open, as artists do: by keys.

    The keys lie on whole frames before and after, so they need no knowledge of the shutter.
    """
    import bpy

    scene = bpy.context.scene
    camera = scene.camera
    here = camera.location.x
    frame = scene.frame_current_final
    speed = 0.3 / (scene.render.motion_blur_shutter * scene.render.frame_map_old)
    speed *= scene.render.frame_map_new
    for offset in (-10, 0, 10):
        camera.location.x = here + offset * speed
        camera.keyframe_insert("location", frame=frame + offset)
    _make_linear(camera)
    if not scene.render.use_motion_blur:
        for thing in scene.objects:
            thing.cycles.use_motion_blur = thing == camera
    scene.render.use_motion_blur = True
    scene.frame_set(1)


def open_the_shutter_late():
    import bpy

    curve = bpy.context.scene.render.motion_blur_shutter_curve
    points = curve.curves[0].points
    points[0].location = (0, 0)
    points[1].location = (0.7, 0)
    points[2].location = (1, 1)
    curve.update()
