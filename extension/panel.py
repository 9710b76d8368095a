"""The side panel of the 3D viewport, and the operators of its buttons."""

from pathlib import Path
from typing import Any, ClassVar

import bpy
from bpy.app.handlers import persistent

from . import drawing, rig_objects, scene_file, silvr
from .scripts.lightfield.core.errors import UserError
from .scripts.lightfield.core.names import FILE

# The keys of new rigs, by type.
NEW_RIGS: dict[str, dict[str, Any]] = {
    "plane": {"cameras": [5, 5]},
    "cuboid": {"cameras": [4, 4, 4]},
    "cylinder": {"cameras": [12, 3]},
    "sphere": {"subdivisions": 2},
    "lattice": {"cameras": [2, 2, 2]},
    "hemisphere": {"count": 50},
    "ring": {"count": 24},
    "spiral": {"count": 50},
}
NEW_CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [1024, 1024]}
# Custom property of a scene: the names of the rigs that were read from the scene YAML.
_OPENED = "plenoforge_opened"
# Seconds without a change after which cameras are checked, if a check takes less than the second.
_PAUSE = 0.5
_QUICK = 1.0


def active(context: Any) -> Any:
    """Return the Empty of the active rig, or None."""
    obj = context.object
    return obj if obj and rig_objects.KEY in obj else None


class RigProperties(bpy.types.PropertyGroup):
    """A rig's name and counts in the panel, which are kept in its Empty's custom property."""

    def _name(self) -> str:
        return rig_objects.kept(self.id_data)[0]

    def _set_name(self, name: str) -> None:
        _, settings = rig_objects.kept(self.id_data)
        rig_objects.keep(self.id_data, name, settings)
        self.id_data.name = name

    def _count(self, index: int) -> int:
        return rig_objects.counts(rig_objects.kept(self.id_data)[1])[index]

    def _set_count(self, index: int, count: int) -> None:
        name, settings = rig_objects.kept(self.id_data)
        rig_objects.keep(self.id_data, name, rig_objects.with_count(settings, index, count))
        drawing.sync(bpy.context.scene)
        _check_soon()

    title: bpy.props.StringProperty(name="Name", get=_name, set=_set_name)
    count_0: bpy.props.IntProperty(
        name="Cameras", min=1, get=lambda self: self._count(0), set=lambda s, n: s._set_count(0, n)
    )
    count_1: bpy.props.IntProperty(
        name="Cameras", min=1, get=lambda self: self._count(1), set=lambda s, n: s._set_count(1, n)
    )
    count_2: bpy.props.IntProperty(
        name="Cameras", min=1, get=lambda self: self._count(2), set=lambda s, n: s._set_count(2, n)
    )


class Button(bpy.types.Operator):
    """The base of operators. A `UserError` becomes Blender's report."""

    def execute(self, context: Any) -> set[str]:
        try:
            context.view_layer.update()
            self.run(context)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class Change(Button):
    """The base of operators that can be undone."""

    bl_options: ClassVar = {"UNDO"}


class OpenYaml(Change):
    """Draw the rigs of a scene YAML, in place of those that are drawn now"""

    bl_idname = "plenoforge.open"
    bl_label = "Open scene YAML"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.yaml;*.yml", options={"HIDDEN"})

    def invoke(self, context: Any, _event: Any) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context: Any) -> None:
        path = Path(bpy.path.abspath(self.filepath)).resolve()
        rigs = scene_file.read(path)
        drawing.cameras_at.cache_clear()
        scene = context.scene
        for empty in rig_objects.empties(scene):
            bpy.data.objects.remove(empty)
        scene.plenoforge_yaml = str(path)
        for name, settings in rigs.items():
            rig_objects.add(scene, name, settings)
        scene[_OPENED] = list(rigs)
        _show(context)


class WriteYaml(Button):
    """Write the rigs to the scene YAML, and record this .blend in its lock"""

    bl_idname = "plenoforge.write"
    bl_label = "Write YAML"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")

    def invoke(self, context: Any, _event: Any) -> set[str]:
        if rig_objects.yaml_path(context.scene):
            return self.execute(context)
        self.filepath = str(Path(bpy.data.filepath).with_suffix(".yaml"))
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context: Any) -> None:
        scene = context.scene
        path = Path(self.filepath) if self.filepath else rig_objects.yaml_path(scene)
        if path is None:
            raise UserError("no scene YAML is open; give the path of one to write")
        drawing.sync(scene)
        blend = Path(bpy.data.filepath) if bpy.data.filepath else None
        rigs = {}
        for empty in rig_objects.empties(scene):
            name, _ = rig_objects.kept(empty)
            _, rigs[name] = rig_objects.rig_of(scene, empty)
        removed = {*scene.get(_OPENED, [])} - rigs.keys()
        line = scene_file.write(path, rigs, removed, blend, is_saved())
        if not rig_objects.yaml_path(scene):
            scene.plenoforge_yaml = str(path)
        scene[_OPENED] = list(rigs)
        self.report({"INFO"}, line)


# Whether something was undone or redone since the .blend was saved or opened.
is_undone = [False]


def is_saved() -> bool:
    """Return whether the .blend's file has all changes. Blender itself does not count an undo."""
    return not (bpy.data.is_dirty or is_undone[0])


@persistent
def on_undo(*_: Any) -> None:
    """Note that the .blend's file may differ. Blender calls this after each undo and redo."""
    is_undone[0] = True


@persistent
def on_file(*_: Any) -> None:
    """Note that the .blend's file is as shown. Blender calls this after it saves or opens one."""
    is_undone[0] = False


class AddRig(Change):
    """Add a rig at the 3D cursor, with the lens of the active rig"""

    bl_idname = "plenoforge.add"
    bl_label = "Add rig"

    type: bpy.props.EnumProperty(items=[(name, name, "") for name in NEW_RIGS])

    def run(self, context: Any) -> None:
        scene = context.scene
        empty = active(context)
        camera = rig_objects.kept(empty)[1]["camera"] if empty else NEW_CAMERA
        center = rig_objects.numbers(scene.cursor.location)
        settings = {"type": self.type, **NEW_RIGS[self.type], "size": 1, "center": center}
        names = {rig_objects.kept(each)[0] for each in rig_objects.empties(scene)}
        name = next(n for i in range(1, 999) if (n := f"{self.type}_{i}") not in names)
        _activate(context, rig_objects.add(scene, name, {**settings, "camera": camera}))
        _show(context)


class RemoveRig(Change):
    """Remove the active rig. Write YAML then removes it from the file"""

    bl_idname = "plenoforge.remove"
    bl_label = "Remove"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return active(context) is not None

    def run(self, context: Any) -> None:
        bpy.data.objects.remove(active(context))
        drawing.sync(context.scene)


class SelectRig(Change):
    """Make this rig the active one"""

    bl_idname = "plenoforge.select"
    bl_label = "Select"

    object_name: bpy.props.StringProperty()

    def run(self, context: Any) -> None:
        _activate(context, bpy.data.objects[self.object_name])


class CheckRigs(Button):
    """Find the cameras that are inside objects, and draw them in red"""

    bl_idname = "plenoforge.check"
    bl_label = "Check cameras"

    def run(self, context: Any) -> None:
        _note_time(drawing.check(context.scene))


class ReadSilvr(Change):
    """Add the light fields that SILVR's add-on keeps in this .blend"""

    bl_idname = "plenoforge.read_silvr"
    bl_label = "Read SILVR rigs"

    def run(self, context: Any) -> None:
        scene = context.scene
        for name, settings, place in silvr.rigs(scene):
            empty = rig_objects.add(scene, name, settings)
            empty.location, empty.rotation_euler, empty.scale = place
        _show(context)


def _activate(context: Any, obj: Any) -> None:
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj


def _show(context: Any) -> None:
    """Draw all rigs, and check their cameras."""
    context.view_layer.update()
    _note_time(drawing.check(context.scene))


class RigPanel(bpy.types.Panel):
    """The rigs of the scene YAML, and the facts of the active one."""

    bl_idname = "VIEW3D_PT_plenoforge"
    bl_label = "Plenoforge"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Plenoforge"

    def draw(self, context: Any) -> None:
        layout = self.layout
        scene = context.scene
        layout.operator(OpenYaml.bl_idname, icon="FILE_FOLDER")
        if silvr.is_in(scene):
            layout.operator(ReadSilvr.bl_idname, icon="IMPORT")
        if path := rig_objects.yaml_path(scene):
            layout.label(text=path.name)
        column = layout.column(align=True)
        for empty in rig_objects.empties(scene):
            icon = "ERROR" if drawing.PROBLEM in empty else "OUTLINER_OB_CAMERA"
            name, _ = rig_objects.kept(empty)
            row = column.operator(
                SelectRig.bl_idname, text=name, icon=icon, depress=empty == active(context)
            )
            row.object_name = empty.name
        row = layout.row(align=True)
        row.operator_menu_enum(AddRig.bl_idname, "type", icon="ADD")
        row.operator(RemoveRig.bl_idname, icon="REMOVE")
        if empty := active(context):
            _draw_rig(layout.box(), scene, empty)
        layout.operator(CheckRigs.bl_idname, icon="VIEWZOOM")
        layout.operator(WriteYaml.bl_idname, icon="FILE_TICK")


def _draw_rig(layout: Any, scene: Any, empty: Any) -> None:
    """Show a rig's name, counts and facts."""
    layout.prop(empty.plenoforge, "title")
    try:
        rig, settings = rig_objects.rig_of(scene, empty)
    except UserError as error:
        layout.label(text=str(error), icon="ERROR")
        return
    column = layout.column(align=True)
    column.enabled = rig_objects.is_editable(rig)
    for index in range(len(rig_objects.counts(settings))):
        key = rig_objects.count_key(settings)
        column.prop(empty.plenoforge, f"count_{index}", text=key.capitalize())
    for line in facts(scene, rig, empty):
        layout.label(text=line)


def facts(scene: Any, rig: Any, empty: Any) -> list[str]:
    """Return the lines of the panel about a rig."""
    placed = drawing.cameras(scene, rig)
    is_of_file = rig.camera.lens == FILE
    lens = "of the .blend's camera" if is_of_file else rig.camera.make().description
    width, height = rig.camera.resolution
    size = " × ".join(f"{side:.3g}" for side in rig.sides)
    inside = drawing.inside(empty)
    lines = [
        f"Type: {rig.type}" + ("" if rig_objects.is_editable(rig) else ", not changed here"),
        f"Cameras: {len(placed.world_from_cameras) or 'known after the build'}",
        f"Size: {size} m",
        f"Lens: {lens}",
        f"Resolution: {width} × {height}",
        "Inside objects: " + ("not checked" if inside is None else str(inside)),
    ]
    if placed.spacing:
        low, high = (f"{value:.3g}" for value in placed.spacing)
        lines.insert(3, f"Spacing: {low} m" if low == high else f"Spacing: {low} to {high} m")
    return lines


# How long the last check took, in seconds.
_last_check = [0.0]


def _note_time(seconds: float) -> None:
    _last_check[0] = seconds


def _check_soon() -> None:
    """Check the cameras after a pause, unless that takes long."""
    if bpy.app.timers.is_registered(_check_now):
        bpy.app.timers.unregister(_check_now)
    if _last_check[0] < _QUICK and not bpy.app.background:
        bpy.app.timers.register(_check_now, first_interval=_PAUSE)


def _check_now() -> None:
    _note_time(drawing.check(bpy.context.scene))


@persistent
def on_change(scene: Any, depsgraph: Any) -> None:
    """Draw the rigs anew whose Empty has changed. Blender calls this after each change."""
    if bpy.app.is_job_running("RENDER") or not depsgraph.id_type_updated("OBJECT"):
        return
    moved = [u.id.original for u in depsgraph.updates if isinstance(u.id, bpy.types.Object)]
    if any(rig_objects.KEY in obj for obj in moved):
        drawing.sync(scene)
        _check_soon()


HANDLERS = (
    (bpy.app.handlers.depsgraph_update_post, on_change),
    (bpy.app.handlers.undo_post, on_undo),
    (bpy.app.handlers.redo_post, on_undo),
    (bpy.app.handlers.save_post, on_file),
    (bpy.app.handlers.load_post, on_file),
)
CLASSES = (
    *(RigProperties, OpenYaml, WriteYaml, AddRig, RemoveRig, SelectRig, CheckRigs, ReadSilvr),
    RigPanel,
)


def register() -> None:
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Object.plenoforge = bpy.props.PointerProperty(type=RigProperties)
    bpy.types.Scene.plenoforge_yaml = bpy.props.StringProperty(subtype="FILE_PATH")
    for handlers, function in HANDLERS:
        handlers.append(function)


def unregister() -> None:
    if bpy.app.timers.is_registered(_check_now):
        bpy.app.timers.unregister(_check_now)
    for handlers, function in HANDLERS:
        handlers.remove(function)
    del bpy.types.Scene.plenoforge_yaml
    del bpy.types.Object.plenoforge
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
