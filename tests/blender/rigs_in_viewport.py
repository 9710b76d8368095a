"""Does in Blender what a user does with the extension, and writes what its panel and objects show.

Usage: rigs_in_viewport.py EXTENSION STEPS OUTPUT. STEPS is JSON: a list of steps, each a function
of this file and its arguments. OUTPUT gets the list of what they return.
"""

import importlib
import itertools
import json
import sys
import time
import types
from pathlib import Path

import bpy
import numpy as np

EMPTY = "plenoforge_rig"


def install(archive):
    """Install the zip as Blender's preferences do. Return the names of what Blender now has."""
    bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True
    )
    return traces()


def register():
    package().register()


def reload():
    """Reload the extension as Blender does after it installs another version of it.

    Return the names of the extension's files that are not loaded anew.
    """
    before = loaded()
    importlib.reload(package())
    return [name for name, module in loaded().items() if before.get(name) is module]


def loaded():
    return {name: each for name, each in sys.modules.items() if name.startswith("plenoforge_rigs.")}


def unregister():
    package().unregister()
    return traces()


def traces():
    """Return what is registered in Blender that names the extension."""
    names = [name for name in dir(bpy.types) if "plenoforge" in name.lower()]
    names += [f"{kind}.plenoforge" for kind in ("Object", "Scene") if has_property(kind)]
    lists = [each for each in bpy.app.handlers if isinstance(each, list)]
    names += ["handler" for each in itertools.chain(*lists) if of_extension(each)]
    return names + [name for name in dir(bpy.ops) if "plenoforge" in name]


def has_property(kind):
    return any("plenoforge" in name for name in dir(getattr(bpy.types, kind)))


def of_extension(function):
    return "plenoforge" in function.__module__


def package():
    return importlib.import_module("plenoforge_rigs")


def open_blend(path):
    bpy.ops.wm.open_mainfile(filepath=path)


def save(path):
    bpy.ops.wm.save_as_mainfile(filepath=path)
    note_saved(True)


def note_saved(is_saved):
    """Say whether the file is saved. In the background, Blender 5.0 does not know."""
    if bpy.app.version < (5, 1):
        package().panel.is_saved = lambda: is_saved


def press(button, **options):
    """Press a button of the panel. Return what Blender reports if it refuses."""
    try:
        getattr(bpy.ops.plenoforge, button)(**options)
    except RuntimeError as error:
        return str(error).removeprefix("Error: ").strip()
    return None


def change(name, **properties):
    """Change properties of a rig's Empty, as handles and the panel do."""
    for path, value in properties.items():
        *parents, last = path.split("__")
        owner = bpy.data.objects[name]
        for parent in parents:
            owner = getattr(owner, parent)
        setattr(owner, last, value)
    bpy.context.view_layer.update()


def view_frame(name, degrees, width, height):
    """Return the corners that Blender's own camera sees from a rig's first view, as directions."""
    settings = package().panel.rig_objects.kept(bpy.data.objects[name])[1]
    pose = package().panel.rig_objects.from_settings(settings).poses()[0]
    data = bpy.data.cameras.new("own")
    data.angle = np.radians(degrees)
    camera = bpy.data.objects.new("own", data)
    camera.location = pose.position
    camera.rotation_euler = pose.rotation
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.render.resolution_x = width
    scene.render.resolution_y = height
    bpy.context.view_layer.update()
    corners = data.view_frame(scene=scene)
    return [list(camera.matrix_world.to_3x3() @ corner) for corner in corners]


def ball(center, properties):
    """Add a ball with a radius of 0.1 m."""
    bpy.ops.mesh.primitive_uv_sphere_add(location=center, radius=0.1)
    for name, value in properties.items():
        setattr(bpy.context.object, name, value)


def type_location(name, location):
    """Type a location into Blender's own panel: the undo step is made before anything is drawn."""
    bpy.data.objects[name].location = location
    push("typed")
    bpy.context.view_layer.update()


def parent(name):
    other = bpy.data.objects.new("other", None)
    other.location.x = 1
    bpy.context.scene.collection.objects.link(other)
    bpy.data.objects[name].parent = other
    bpy.context.view_layer.update()


def delete(name):
    bpy.data.objects.remove(bpy.data.objects[name])
    bpy.context.view_layer.update()


def duplicate(name):
    copy = bpy.data.objects[name].copy()
    copy.location.x += 5
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.update()


def select(name):
    press("select", object_name=name)


def undo():
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo()


def build_of(seconds):
    """Call the timer's function as Blender does, until the build has ended. Return its states."""
    preview = package().preview
    states = []
    end = time.monotonic() + seconds
    while (interval := preview.tick()) is not None:
        assert time.monotonic() < end, states
        states.append(preview.last().state)
        time.sleep(interval)
    return [*dict.fromkeys(states), preview.last().state]


def started(seconds):
    """Wait until the build has started its jobs. Return its process."""
    preview = package().preview
    end = time.monotonic() + seconds
    while "views in" not in preview.last().state and "jobs" not in preview.last().state:
        assert time.monotonic() < end, preview.last().state
        time.sleep(0.5)
        preview.tick()
    return preview.last()._process.pid


def pressed_for(button):
    """Press a button. Return the seconds for which Blender could do nothing else."""
    start = time.monotonic()
    assert press(button) is None
    return time.monotonic() - start


def set_scene(**properties):
    for name, value in properties.items():
        setattr(bpy.context.scene, name, value)


def is_undone():
    return package().panel.is_undone[0]


def push(message):
    bpy.ops.ed.undo_push(message=message)
    note_saved(False)


def rigs():
    """Return each rig's drawn cameras: the points of those outside and inside, by its name."""
    shown = {}
    for obj in bpy.data.objects:
        if EMPTY in obj:
            shown[json.loads(obj[EMPTY])["name"]] = {
                drawn["plenoforge_part"]: points(drawn)
                for drawn in bpy.data.objects
                if drawn.get("plenoforge_of") == obj
            }
    return shown


def points(drawn):
    assert drawn.hide_render
    assert drawn.matrix_world.is_identity
    coordinates = np.empty(3 * len(drawn.data.vertices))
    drawn.data.vertices.foreach_get("co", coordinates)
    assert not drawn.data.validate()
    return coordinates.reshape(-1, 3).tolist()


def facts(name):
    """Return the lines of the panel about a rig."""
    module = package()
    scene = bpy.context.scene
    obj = bpy.data.objects[name]
    return module.panel.facts(scene, module.panel.rig_objects.rig_of(scene, obj)[0], obj)


class Layout:
    """A layout without windows. It takes what Blender's takes, and notes the texts."""

    def __init__(self, texts):
        self.texts = texts

    def __getattr__(self, name):
        function = bpy.types.UILayout.bl_rna.functions[name]

        def add(*arguments, **options):
            names = [each.identifier for each in function.parameters if not each.is_output]
            given = dict(zip(names, arguments, strict=False)) | options
            assert given.keys() <= {*names}
            if "icon" in given:
                assert given["icon"] in function.parameters["icon"].enum_items
            if "property" in given and "data" in given:
                assert given["property"] in given["data"].bl_rna.properties
                self.texts.append(str(getattr(given["data"], given["property"])))
            if "operator" in given:
                group, operator = given["operator"].split(".")
                operator_type = getattr(getattr(bpy.ops, group), operator).get_rna_type()
                self.texts.append(given.get("text") or operator_type.name)
                return types.SimpleNamespace()
            self.texts += [given["text"]] if "text" in given else []
            return Layout(self.texts)

        return add


def panel():
    """Return the texts of the panel."""
    texts = []
    drawn = types.SimpleNamespace(layout=Layout(texts))
    package().panel.RigPanel.draw(drawn, bpy.context)
    return texts


def main():
    extension, steps, output = sys.argv[1:]
    sys.path.insert(0, extension)
    bpy.ops.wm.read_factory_settings()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    results = [
        globals()[name](*arguments, **options)
        for name, arguments, options in json.loads(Path(steps).read_text())
    ]
    Path(output).write_text(json.dumps(results))


if __name__ == "__main__":
    main()
