"""Reads the dependency graph that Blender evaluates for a render of the current frame.

The viewport may show other objects, other levels of detail and fewer particles. Blender gives a
render's dependency graph only to the render engine.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, ClassVar, TypeVar

import bpy

from lightfield.rendering.scenes.quiet import quiet

Result = TypeVar("Result")

# Settings for additional work of a render. They are off while the graph is read.
_EXTRAS = ("use_border", "use_compositing", "use_freestyle", "use_multiview", "use_sequencer")


class _GraphReader(bpy.types.RenderEngine):  # type: ignore[misc]
    """A render engine that passes the dependency graph to a function, and makes no picture."""

    bl_idname = "PLENOFORGE_READER"
    bl_label = "Plenoforge Reader"

    read: ClassVar[Callable[[Any], None]]

    def render(self, depsgraph: Any) -> None:
        _GraphReader.read(depsgraph)


bpy.utils.register_class(_GraphReader)


def in_render(read: Callable[[Any], Result]) -> Result:
    """Call ``read`` with the dependency graph of a render of the open scene. Return its result.

    The result must not refer to the graph, which ends with the render.
    """
    results: list[Result] = []
    _GraphReader.read = lambda depsgraph: results.append(read(depsgraph))
    render = bpy.context.scene.render
    with ExitStack() as stack:
        stack.enter_context(_some_camera())
        stack.enter_context(changed(render, "engine", _GraphReader.bl_idname))
        for name in _EXTRAS:
            stack.enter_context(changed(render, name, False))
        with quiet():
            bpy.ops.render.render()
    (result,) = results
    return result


@contextmanager
def changed(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Change a property, and restore it afterwards."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


@contextmanager
def _some_camera() -> Iterator[None]:
    """Make sure that the scene has a camera: without one Blender renders nothing."""
    scene = bpy.context.scene
    if scene.camera:
        yield
        return
    scene.camera = bpy.data.objects.new("any", bpy.data.cameras.new("any"))
    try:
        yield
    finally:
        bpy.data.cameras.remove(scene.camera.data)
