"""What a dataset takes from a user's .blend, and in words what it takes and what it does not.

What the .blend says is in the scene's inventory: under ``blend`` what `lightfield.rendering`'s
``blend_facts`` found, and under ``missing`` which of its files are not there.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.rectilinear import RectilinearSettings

Settings = Mapping[str, Any]

ENGINES = {
    "BLENDER_EEVEE": "EEVEE",
    "BLENDER_EEVEE_NEXT": "EEVEE",
    "BLENDER_WORKBENCH": "Workbench",
}

# Metres between which a new camera in Blender sees.
_BLENDERS_CLIP = (0.1, 1000)
# Blender's name of the colours in which all datasets are.
REC_709 = "Linear Rec.709"


def camera_of(blend: Settings) -> Settings:
    """Return the .blend's camera; raises `UserError` where its scene has none."""
    if blend["camera"] is None:
        raise UserError(
            f"the .blend's scene {blend['scene']} has no camera, which blend_camera and "
            "depth_of_field need"
        )
    camera: Settings = blend["camera"]
    return camera


def lens_of(blend: Settings, resolution: tuple[int, int]) -> RectilinearSettings:
    """Return the lens of the .blend's own camera, for images of another resolution.

    Raises `UserError` unless it is a perspective one.
    """
    camera = camera_of(blend)
    lens = camera["lens"]
    if lens["type"] != "PERSP":
        raise UserError(
            f"the .blend's camera {camera['name']} is no perspective one; instead of lens: file, "
            "give the rig's camera its lens"
        )
    width, height = resolution
    fit = lens["sensor_fit"]
    # AUTO fits the sensor's width, whichever side of the image is the longer.
    across = fit == "HORIZONTAL" or (fit == "AUTO" and width >= height)
    side = width if across else height
    millimetres = lens["sensor_height" if fit == "VERTICAL" else "sensor_width"] / side
    settings = RectilinearSettings(
        lens="rectilinear",
        focal_length=lens["lens"],
        sensor_size=(width * millimetres, height * millimetres),
        resolution=(width, height),
    )
    if not lens["shift_x"] and not lens["shift_y"]:
        return settings
    # Blender shifts by parts of the side that the sensor is fitted to, and up.
    point = (width / 2 - lens["shift_x"] * side, height / 2 + lens["shift_y"] * side)
    return settings.model_copy(update={"principal_point": point})


def taken(
    inventory: Settings,
    frames: Sequence[int],
    render: Settings,
    own_camera: bool,
) -> list[str]:
    """Return in words, one entry a fact, what is taken of a .blend and what is not.

    ``frames`` of it are rendered, as this ``render`` block has it; ``own_camera`` says whether by a
    rig of the .blend's own camera.
    """
    blend = inventory["blend"]
    return [
        *_scene(blend, frames, render),
        *_camera(blend["camera"], own_camera),
        *(f"{name} ignored" for name in ("compositor", "sequencer") if blend[name]),
        *_switches(blend, render),
        *_display(blend),
        *_film(blend, render),
        *_missing(inventory["missing"]),
    ]


def _scene(blend: Settings, frames: Sequence[int], render: Settings) -> Iterator[str]:
    """Yield which scene, frames and view layers are rendered, and with how many samples."""
    layers = blend["layers"]
    if len(blend["scenes"]) > 1:
        yield f"scene {blend['scene']} of {len(blend['scenes'])}"
    yield _frames(frames, blend["frame"])
    if blend["view_layers"] > 1:
        together = "" if len(layers) == 1 else " in one picture"
        name = "view layer" if len(layers) == 1 else "view layers"
        yield f"{name} {' and '.join(layers)} of {blend['view_layers']}{together}"
    if blend["engine"] != "CYCLES":
        made_for = ENGINES.get(blend["engine"], blend["engine"])
        yield f"made for {made_for}, rendered with Cycles"
    if isinstance(render.get("samples"), int):
        yield _samples(render["samples"], blend["samples"])
    elif "samples" in render:
        yield _samples(blend["samples"], blend["samples"])


def _camera(camera: Settings | None, is_taken: bool) -> Iterator[str]:
    """Yield what is taken of the .blend's own camera."""
    if not camera:
        return
    lens = camera["lens"]
    length = f" ({lens['lens']:g} mm)" if lens["type"] == "PERSP" else ""
    yield f"camera {camera['name']}{length} {'taken' if is_taken else 'ignored'}"
    # An inventory from before this was looked at has none.
    near, far = camera.get("clip", _BLENDERS_CLIP)
    if is_taken and (near > _BLENDERS_CLIP[0] or far < _BLENDERS_CLIP[1]):
        yield f"clip planes at {near:g} and {far:g} m ignored"


def _switches(blend: Settings, render: Settings) -> Iterator[str]:
    """Yield what is on or off here, of what is on here or in the .blend."""
    focus = bool(blend["camera"] and blend["camera"]["lens"]["depth_of_field"])
    for name, is_on, is_on_in_blend in (
        ("adaptive sampling", bool(render.get("adaptive_threshold")), blend["adaptive_sampling"]),
        ("denoising", bool(render.get("denoise")), blend["denoising"]),
        ("depth of field", bool(render.get("depth_of_field")), focus),
        ("motion blur", render.get("motion_blur", blend["motion_blur"]), blend["motion_blur"]),
    ):
        if is_on or is_on_in_blend:
            yield f"{name} {'ON' if is_on else 'off'}"


def _display(blend: Settings) -> Iterator[str]:
    """Yield what Blender would change of the colours when it shows or saves a picture."""
    yield f"view transform {blend['view_transform']} ignored"
    if blend["look"] != "None":
        yield f"look {blend['look']} ignored"
    if blend["exposure"]:
        yield f"view exposure {blend['exposure']:+g} ignored"
    if blend["gamma"] != 1:
        yield f"view gamma {blend['gamma']:g} ignored"
    if blend["curves"]:
        yield "view curves ignored"


def _film(blend: Settings, render: Settings) -> Iterator[str]:
    """Yield what the .blend says of the film, of units, and of what it runs."""
    if render.get("transparent"):
        yield "film transparent ON"
    elif blend["film_transparent"]:
        yield "film transparent on, ignored"
    # An inventory from before this was looked at has none.
    if blend.get("pixel_aspect", 1) != 1:
        yield f"pixel aspect {blend['pixel_aspect']:g} ignored, pixels are square"
    for name, title in (
        ("border", "render border"),
        ("stereoscopy", "stereoscopy"),
        ("freestyle", "Freestyle lines"),
    ):
        if blend[name]:
            yield f"{title} ignored"
    if blend["simplify"]:
        yield "simplify ON"
    if blend.get("working_space", REC_709) != REC_709:
        yield f"working space {blend['working_space']} converted to Rec. 709"
    if blend["unit_scale"] != 1:
        yield f"unit scale {blend['unit_scale']:g} ignored"
    if blend["scripts"]:
        yield "scripts and drivers in Python not run"


def _frames(frames: Sequence[int], own: int) -> str:
    text = f"frame {frames[0]}" if len(frames) == 1 else f"frames {frames[0]} to {frames[-1]}"
    return f"{text}, the file's" if list(frames) == [own] else f"{text} (the file is at {own})"


def _samples(samples: int, own: int) -> str:
    text = f"{samples} {'sample' if samples == 1 else 'samples'} a pixel"
    return f"{text}, the file's" if samples == own else f"{text} (the file has {own})"


def _missing(missing: Sequence[Settings]) -> list[str]:
    """Return what is missing, or cannot be read, by kind: ``2 textures missing: a.png, b.png``."""
    names: dict[tuple[str, str], list[str]] = {}
    for entry in missing:
        names.setdefault((entry["kind"], entry["problem"]), []).append(entry["path"])
    return [
        f"{len(paths)} {_plural(kind) if len(paths) > 1 else kind} {problem}: {', '.join(paths)}"
        for (kind, problem), paths in names.items()
    ]


def _plural(kind: str) -> str:
    return f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
