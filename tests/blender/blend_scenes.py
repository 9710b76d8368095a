"""Small .blend scenes in which a setting of the file can change the picture.

blend_settings.py says what becomes of each setting. Each function here adds to the open scene what
a setting needs. `roots` returns the owners of settings by short names.
"""

SIZE = (64, 48)
SAMPLES = 4


def studio():
    """Make the scene of all cases: a ground, three bodies, two lamps, a sky, and a camera.

    The file's settings are those of the scene YAML, so that the tested one alone differs.
    """
    import bpy

    from lightfield.configuration.keys import view_seed
    from lightfield.rendering.scenes import blend_file

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
    # Paths begin at the near plane. A last digit of their beginning changes some of them, so this
    # plane is where that of the views is, and rounding does not change the pose.
    camera.data.clip_start, camera.data.clip_end = 1e-4, 1e9
    for _ in range(4):
        bpy.context.view_layer.update()
        camera.matrix_world = camera.matrix_world.normalized()


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


def shaking_cube():
    """Blur a cube that goes to and fro while the shutter is open."""
    import bpy

    studio()
    cube = bpy.data.objects["Cube"]
    for frame, x in ((0.75, -0.5), (0.875, 0.5), (1, -0.5), (1.125, 0.5), (1.25, -0.5)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    _make_linear(cube)
    bpy.context.scene.frame_set(1)
    bpy.context.scene.render.use_motion_blur = True


def growing_cube():
    """Blur a cube that grows by a shape key."""
    import bpy

    studio()
    cube = bpy.data.objects["Cube"]
    cube.shape_key_add(name="Basis")
    tall = cube.shape_key_add(name="Tall")
    for point in tall.data:
        point.co.z *= 3
    for frame, value in ((0, 0), (2, 1)):
        tall.value = value
        tall.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_set(1)
    bpy.context.scene.render.use_motion_blur = True


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
        "world_ambient": scene.world.light_settings,
        "ground": bpy.data.objects["Ground"],
        "chrome": bpy.data.objects["Chrome"],
        "cube": bpy.data.objects["Cube"],
        "cube_cycles": bpy.data.objects["Cube"].cycles,
        "lamp": bpy.data.lights["Lamp"],
        "lamp_cycles": bpy.data.lights["Lamp"].cycles,
        "lamp_object": bpy.data.objects["Lamp"],
        "material": bpy.data.materials["Red"],
        "material_cycles": bpy.data.materials["Red"].cycles,
        "fog_cycles": getattr(bpy.data.materials.get("Fog"), "cycles", None),
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
    from lightfield.rendering.scenes import animation

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


def move_the_camera_without_blur():
    """Let the camera travel as `move_the_camera` does, in a file without motion blur."""
    import bpy

    move_the_camera()
    bpy.context.scene.render.use_motion_blur = False


def blur():
    """Turn motion blur on."""
    import bpy

    bpy.context.scene.render.use_motion_blur = True


def open_the_shutter_late():
    import bpy

    curve = bpy.context.scene.render.motion_blur_shutter_curve
    points = curve.curves[0].points
    points[0].location = (0, 0)
    points[1].location = (0.7, 0)
    points[2].location = (1, 1)
    curve.update()


def cube_at_seconds():
    """Let geometry nodes move the cube by the seconds of the scene's time."""
    import bpy

    studio()
    tree = bpy.data.node_groups.new("Seconds", "GeometryNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    nodes = tree.nodes
    time = nodes.new("GeometryNodeInputSceneTime")
    vector = nodes.new("ShaderNodeCombineXYZ")
    move = nodes.new("GeometryNodeTransform")
    tree.links.new(time.outputs["Seconds"], vector.inputs["Z"])
    tree.links.new(nodes.new("NodeGroupInput").outputs[0], move.inputs["Geometry"])
    tree.links.new(vector.outputs[0], move.inputs["Translation"])
    tree.links.new(move.outputs[0], nodes.new("NodeGroupOutput").inputs[0])
    modifier = bpy.data.objects["Cube"].modifiers.new("Seconds", "NODES")
    modifier.node_group = tree
    bpy.context.scene.render.fps = 4


def put_a_scene_behind():
    """Show another scene's sphere behind this one, as a background scene."""
    import bpy

    other = bpy.data.scenes.new("Behind")
    ball = _put(other.collection, "Moon", _sphere("Moon", 1), location=(0, 4, 1))
    ball.data.materials.append(_material("Moon", (0.9, 0.9, 0.1, 1)))
    bpy.context.scene.background_set = other


def invert_in_the_compositor():
    import bpy

    scene = bpy.context.scene
    tree = bpy.data.node_groups.new("Grading", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    layers = tree.nodes.new("CompositorNodeRLayers")
    invert = tree.nodes.new("CompositorNodeInvert")
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(layers.outputs["Image"], invert.inputs["Color"])
    tree.links.new(invert.outputs[0], output.inputs[0])
    scene.compositing_node_group = tree


def cut_to_a_colour_strip():
    import bpy

    scene = bpy.context.scene
    editor = scene.sequence_editor_create()
    strip = editor.strips.new_effect("Red", "COLOR", channel=1, frame_start=1, length=9)
    strip.color = (1, 0, 0)


def burn_a_stamp():
    import bpy

    render = bpy.context.scene.render
    render.use_stamp = True
    render.use_stamp_note = True
    render.stamp_note_text = "draft"


def hairy_cube():
    """Grow thick hair from the cube."""
    import bpy

    studio()
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([4] * 49)
    points = []
    for curve in range(49):
        x, y = (curve % 7) / 8 - 0.4, (curve // 7) / 8 - 0.4
        points += [(x, y, 0.4), (x, y, 0.7), (1.3 * x, y, 0.9), (1.8 * x, 1.2 * y, 0.8)]
    hair.position_data.foreach_set("vector", [value for point in points for value in point])
    radius = hair.attributes.get("radius") or hair.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.04] * len(points))
    hair.materials.append(bpy.data.materials["Red"])
    thing = _put(bpy.context.scene.collection, "Hair", hair)
    thing.location = bpy.data.objects["Cube"].location


def particle_hair():
    """Grow children of hair particles from the cube."""
    import bpy

    studio()
    cube = bpy.data.objects["Cube"]
    cube.modifiers.new("Fur", "PARTICLE_SYSTEM")
    settings = cube.particle_systems[0].settings
    settings.type = "HAIR"
    settings.count = 60
    settings.hair_length = 0.6
    settings.root_radius = 4
    settings.child_type = "SIMPLE"
    settings.rendered_child_count = 4


def rounded_cube():
    """Round the cube by subdivision."""
    import bpy

    studio()
    cube = bpy.data.objects["Cube"]
    cube.data.shade_smooth()
    rounds = cube.modifiers.new("Round", "SUBSURF")
    rounds.levels = rounds.render_levels = 3


def waves():
    """Displace the ground, which is diced as finely as the camera sees it."""
    import bpy

    studio()
    ground = bpy.data.objects["Ground"]
    dice = ground.modifiers.new("Dice", "SUBSURF")
    dice.subdivision_type = "SIMPLE"
    # Blender 5.0 has these in other places.
    if hasattr(dice, "use_adaptive_subdivision"):
        dice.use_adaptive_subdivision = True
    else:
        ground.cycles.use_adaptive_subdivision = True
    material = ground.data.materials[0]
    material.displacement_method = "BOTH"
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 3
    height = tree.nodes.new("ShaderNodeDisplacement")
    height.inputs["Scale"].default_value = 0.5
    tree.links.new(noise.outputs[0], height.inputs["Height"])
    tree.links.new(height.outputs[0], tree.get_output_node("ALL").inputs["Displacement"])


def fog():
    """Put uneven fog around the cube."""
    import bpy

    studio()
    box = _put(bpy.data.collections["Things"], "Fog", _box("Fog"))
    box.location = (-0.5, -0.5, 0.3)
    box.scale = (2, 2, 1.5)
    bpy.context.scene.cycles.volume_biased = True
    material = bpy.data.materials.new("Fog")
    box.data.materials.append(material)
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    volume = tree.nodes.new("ShaderNodeVolumePrincipled")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 2
    tree.links.new(noise.outputs[0], volume.inputs["Density"])
    tree.links.new(volume.outputs[0], output.inputs["Volume"])


def leaves():
    """Cover the cube's material with holes: it is half transparent."""

    studio()
    shader = _principled("Red")
    shader.inputs["Alpha"].default_value = 0.5


def tinted_cube():
    """Let the cube's material show the colour of the object."""
    import bpy

    studio()
    tree = bpy.data.materials["Red"].node_tree
    info = tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(info.outputs["Color"], _principled("Red").inputs["Base Color"])


def bumpy_cube():
    """Give the cube's material a bump and a displacement."""
    import bpy

    rounded_cube()
    tree = bpy.data.materials["Red"].node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Strength"].default_value = 1
    bump.inputs["Distance"].default_value = 0.5
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], _principled("Red").inputs["Normal"])
    height = tree.nodes.new("ShaderNodeDisplacement")
    height.inputs["Scale"].default_value = 0.6
    tree.links.new(noise.outputs[0], height.inputs["Height"])
    tree.links.new(height.outputs[0], tree.get_output_node("ALL").inputs["Displacement"])


def textured_cube():
    """Give the cube a texture with a fine pattern."""
    import bpy
    import numpy as np

    studio()
    size = 256
    image = bpy.data.images.new("Stripes", size, size)
    stripes = np.ones((size, size, 4), np.float32)
    stripes[:, :, 0] = np.arange(size) // 16 % 2
    image.pixels.foreach_set(stripes.ravel())
    image.pack()
    tree = bpy.data.materials["Red"].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], node.inputs["Vector"])
    tree.links.new(node.outputs[0], _principled("Red").inputs["Base Color"])


def glowing_cube():

    studio()
    shader = _principled("Red")
    shader.inputs["Emission Color"].default_value = (1, 0.5, 0.2, 1)
    shader.inputs["Emission Strength"].default_value = 3


def _principled(material):
    import bpy

    nodes = bpy.data.materials[material].node_tree.nodes
    return next(n for n in nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")


def denoise():
    import bpy

    bpy.context.scene.cycles.use_denoising = True


def denoised():
    """Denoise the studio as Plenoforge does."""
    import bpy

    studio()
    denoise()
    bpy.context.scene.cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    bpy.context.scene.cycles.denoising_prefilter = "ACCURATE"
    bpy.context.scene.cycles.denoising_quality = "HIGH"


def stop_early():
    """Stop sampling early where there is little noise."""
    import bpy

    cycles = bpy.context.scene.cycles
    cycles.use_adaptive_sampling = True
    cycles.adaptive_threshold = 0.5
    cycles.adaptive_min_samples = 1


def many_samples():
    import bpy

    studio()
    bpy.context.scene.cycles.samples = 32


def tabulated_noise():
    import bpy

    studio()
    bpy.context.scene.cycles.sampling_pattern = "TABULATED_SOBOL"


def clear_glass():
    """Let the transparent film be seen through glass."""
    import bpy

    studio()
    bpy.context.scene.cycles.film_transparent_glass = True


def focused():
    """Focus on the near ball."""
    import bpy

    studio()
    focus = bpy.context.scene.camera.data.dof
    focus.use_dof = True
    focus.aperture_fstop = 0.1
    focus.focus_distance = 3


def focus_on_the_chrome():
    import bpy

    bpy.context.scene.camera.data.dof.focus_object = bpy.data.objects["Chrome"]


def add_a_layer_without_the_bodies():
    """Add a second view layer. It comes first, and shows all but the bodies."""
    import bpy

    scene = bpy.context.scene
    scene.view_layers.new("Second")
    scene.view_layers[0].use = False
    scene.view_layers["Second"].layer_collection.children["Things"].exclude = True


def override_the_materials():
    import bpy

    bpy.context.scene.view_layers[0].material_override = bpy.data.materials["Chrome"]


def override_the_world():
    import bpy

    world = bpy.data.worlds.new("Other")
    tree = world.node_tree
    shader = next((n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground"), None)
    if shader is None:
        shader = tree.nodes.new("ShaderNodeBackground")
        output = tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(shader.outputs[0], output.inputs[0])
    shader.inputs[0].default_value = (0.9, 0.2, 0.1, 1)
    bpy.context.scene.view_layers[0].world_override = world


def textured_world():
    """Light the scene by a world with a bright spot."""
    import bpy

    studio()
    tree = bpy.context.scene.world.node_tree
    background = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    gradient = tree.nodes.new("ShaderNodeTexNoise")
    gradient.inputs["Scale"].default_value = 6
    power = tree.nodes.new("ShaderNodeMath")
    power.operation = "POWER"
    power.inputs[1].default_value = 8
    tree.links.new(coordinates.outputs["Generated"], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs[0], power.inputs[0])
    tree.links.new(power.outputs[0], background.inputs["Strength"])
    background.inputs[0].default_value = (90, 80, 70, 1)
    map_the_sky_coarsely()


def map_the_sky_coarsely():
    """Sample the world by a small map, because a large one takes seconds."""
    import bpy

    settings = bpy.context.scene.world.cycles
    settings.sampling_method = "MANUAL"
    settings.sample_map_resolution = 64


def link_the_lamp_to_the_ground():
    """Let the lamp shine on the ground alone."""
    import bpy

    receivers = bpy.data.collections.new("Receivers")
    receivers.objects.link(bpy.data.objects["Ground"])
    bpy.data.objects["Lamp"].light_linking.receiver_collection = receivers


def block_the_lamp_by_nothing():
    """Let no body cast a shadow of the lamp."""
    import bpy

    blockers = bpy.data.collections.new("Blockers")
    blockers.objects.link(bpy.data.objects["Ground"])
    bpy.data.objects["Lamp"].light_linking.blocker_collection = blockers


def instances():
    """Show the bodies a second time, as an instance of their collection."""
    import bpy

    studio()
    empty = _put(bpy.context.scene.collection, "Copies", None, location=(0, 2, 1.5))
    empty.instance_type = "COLLECTION"
    empty.instance_collection = bpy.data.collections["Things"]


def balls_on_faces():
    """Put a small ball on each face of the cube."""
    import bpy

    studio()
    cube = bpy.data.objects["Cube"]
    ball = bpy.data.objects["Ball"]
    ball.parent = cube
    ball.scale = (0.3, 0.3, 0.3)
    cube.instance_type = "FACES"


def hide_the_round_in_renders():
    import bpy

    bpy.data.objects["Cube"].modifiers["Round"].show_render = False


def area_lamp():
    """Make the lamp a square."""
    import bpy

    studio()
    bpy.data.lights["Lamp"].type = "AREA"
    # A light of another type is another object in Python.
    bpy.data.lights["Lamp"].size = 2
    map_the_sky_coarsely()
    bpy.data.objects["Lamp"].rotation_euler = (0.6, 0.4, 0)


def spotlight():
    import bpy

    studio()
    bpy.data.lights["Lamp"].type = "SPOT"
    bpy.data.objects["Lamp"].rotation_euler = (0.6, 0.4, 0)


def bend_the_curve():
    import bpy

    view = bpy.context.scene.view_settings
    view.use_curve_mapping = True
    view.curve_mapping.curves[3].points[1].location = (1, 0.3)
    view.curve_mapping.update()
