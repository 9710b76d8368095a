"""What a render shows at the scene's present frame, as Blender evaluates it for the render.

The viewport may show other objects, other levels of detail and fewer particles. Blender gives a
render's dependency graph only to the engine that renders.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, ClassVar, TypeVar

import bpy

from lightfield.rendering.quiet import quiet

Result = TypeVar("Result")

# What a render may do beside, by its settings.
_BESIDE = ("use_border", "use_compositing", "use_freestyle", "use_multiview", "use_sequencer")


class _Reader(bpy.types.RenderEngine):  # type: ignore[misc]
    """A render engine that hands the dependency graph to a function, and makes no picture."""

    bl_idname = "PLENOFORGE_READER"
    bl_label = "Plenoforge Reader"

    read: ClassVar[Callable[[Any], None]]

    def render(self, depsgraph: Any) -> None:
        _Reader.read(depsgraph)


bpy.utils.register_class(_Reader)


def in_render(look: Callable[[Any], Result]) -> Result:
    """Return what ``look`` makes of the dependency graph of a render of the open scene.

    It must return nothing of the graph itself, which ends with the render.
    """
    results: list[Result] = []
    _Reader.read = lambda depsgraph: results.append(look(depsgraph))
    render = bpy.context.scene.render
    with ExitStack() as stack:
        stack.enter_context(_some_camera())
        stack.enter_context(changed(render, "engine", _Reader.bl_idname))
        for name in _BESIDE:
            stack.enter_context(changed(render, name, False))
        with quiet():
            bpy.ops.render.render()
    (result,) = results
    return result


@contextmanager
def changed(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Give a property another value for a while."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


@contextmanager
def _some_camera() -> Iterator[None]:
    """Let the scene have a camera for a while, without which Blender renders nothing."""
    scene = bpy.context.scene
    if scene.camera:
        yield
        return
    scene.camera = bpy.data.objects.new("any", bpy.data.cameras.new("any"))
    try:
        yield
    finally:
        bpy.data.cameras.remove(scene.camera.data)
