"""The settings that a dataset takes from a user's .blend, and notes on taken and ignored ones.

The scene's inventory describes the .blend. Its key ``blend`` has what `lightfield.rendering`'s
``blend_facts`` read. Its key ``missing`` has the files that the .blend lacks.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.units import count
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry.lenses.rectilinear import RectilinearSettings
from lightfield.imaging.blender_looks import DISPLAY, NO_LOOK

Settings = Mapping[str, Any]

_ENGINES = {
    "BLENDER_EEVEE": "EEVEE",
    "BLENDER_EEVEE_NEXT": "EEVEE",
    "BLENDER_WORKBENCH": "Workbench",
}

# The clipping planes of a new camera in Blender, in metres.
_BLENDERS_CLIP = (0.1, 1000)
# Blender's name for the colour space of all datasets.
REC_709 = "Linear Rec.709"


def camera_of(blend: Settings) -> Settings:
    """Return the .blend's camera. Raises `UserError` if its scene has none."""
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
            f"the .blend's camera {camera['name']} is not a perspective one; instead of lens: "
            "file, give the rig's camera its lens"
        )
    width, height = resolution
    fit = lens["sensor_fit"]
    # AUTO fits the sensor's width to the longer side of the image.
    fits_width = fit == "HORIZONTAL" or (fit == "AUTO" and width >= height)
    side = width if fits_width else height
    millimetres = lens["sensor_height" if fit == "VERTICAL" else "sensor_width"] / side
    settings = RectilinearSettings(
        lens="rectilinear",
        focal_length=lens["lens"],
        sensor_size=(width * millimetres, height * millimetres),
        resolution=(width, height),
    )
    if not lens["shift_x"] and not lens["shift_y"]:
        return settings
    # Blender's shifts are parts of the fitted side, and point up.
    point = (width / 2 - lens["shift_x"] * side, height / 2 + lens["shift_y"] * side)
    return settings.model_copy(update={"principal_point": point})


def has_motion_blur(blend: Settings, render: RenderBlock) -> bool:
    """Return whether moving objects are blurred."""
    return bool(blend["motion_blur"] if render.motion_blur is None else render.motion_blur)


def is_blurred(blend: Settings, render: RenderBlock) -> bool:
    """Return whether views are blurred by the motion of objects or of the camera."""
    return has_motion_blur(blend, render) or render.camera_motion is not None


def is_shutter_reset(blend: Settings, render: RenderBlock) -> bool:
    """Return whether views are blurred at other times than a render of the .blend itself."""
    if not is_blurred(blend, render):
        return False
    old, new = blend["remapped"]
    return bool(
        blend["shutter_position"] != "CENTER"
        or blend["shutter_curve"]
        or blend["rolling_shutter"]
        or (render.camera_motion is not None and old != new)
    )


def followed_camera(blend: Settings, choice: str | None) -> str | None:
    """Return which camera objects of a .blend follow: "file", or "view" for each view's own.

    ``choice`` is the key of the scene YAML. Return None if no view depends on the choice.
    """
    followers = blend["followers"]
    # Objects that name the file's camera follow it, unless the choice is "view".
    needs_choice = followers["active"] or (choice == "view" and followers["by_name"])
    return choice or "file" if needs_choice else None


def usage_notes(
    inventory: Settings,
    frames: Sequence[float],
    render: RenderBlock,
    uses_camera: bool,
    followed: str | None,
    uses_look: bool,
) -> list[str]:
    """Return notes on which settings of a .blend a dataset takes and which it ignores.

    ``frames`` and the ``render`` block say what is rendered. ``uses_camera`` says whether a rig
    uses the .blend's own camera, and ``followed`` is `followed_camera`. ``uses_look`` says whether
    something is developed with the .blend's look.
    """
    blend = inventory["blend"]
    return [
        *_scene(blend, frames, render),
        *_camera(blend["camera"], uses_camera),
        *_followers(blend["followers"], followed),
        *(f"{name} ignored" for name in ("compositor", "sequencer") if blend[name]),
        *_switches(blend, render),
        *_exposure(blend, render),
        *_display(blend, uses_look),
        *_film(blend, render),
        *_missing(inventory["missing"]),
    ]


def _scene(blend: Settings, frames: Sequence[float], render: RenderBlock) -> Iterator[str]:
    """Yield notes on the rendered scene, frames, view layers, and samples."""
    layers = blend["layers"]
    if len(blend["scenes"]) > 1:
        yield f"scene {blend['scene']} of {len(blend['scenes'])}"
    yield _frames(frames, blend["frame"])
    old, new = blend["remapped"]
    if old != new:
        yield f"frames remapped from {old} to {new}"
    if blend["view_layers"] > 1:
        together = "" if len(layers) == 1 else " in one picture"
        name = "view layer" if len(layers) == 1 else "view layers"
        yield f"{name} {' and '.join(layers)} of {blend['view_layers']}{together}"
    if blend["engine"] != "CYCLES":
        made_for = _ENGINES.get(blend["engine"], blend["engine"])
        yield f"made for {made_for}, rendered with Cycles"
    if isinstance(render.samples, int):
        yield _samples(render.samples, blend["samples"])
    elif render.samples is not None:
        yield _samples(blend["samples"], blend["samples"])


def _camera(camera: Settings | None, is_taken: bool) -> Iterator[str]:
    """Yield notes on the .blend's own camera."""
    if not camera:
        return
    lens = camera["lens"]
    length = f" ({lens['lens']:g} mm)" if lens["type"] == "PERSP" else ""
    use = "taken" if is_taken else "ignored: the rigs place the cameras"
    yield f"camera {camera['name']}{length} {use}"
    near, far = camera["clip"]
    if is_taken and (near > _BLENDERS_CLIP[0] or far < _BLENDERS_CLIP[1]):
        yield f"clip planes at {near:g} and {far:g} m ignored"


def _followers(followers: Mapping[str, Sequence[str]], followed: str | None) -> Iterator[str]:
    """Yield a note on what follows the .blend's camera."""
    names = sorted({*followers["by_name"], *followers["active"]})
    if names:
        listed = f"{', '.join(names[:8])}{' …' if len(names) > 8 else ''}"
        camera = "each view's camera" if followed == "view" else "the file's camera in all views"
        yield f"{listed} {'follow' if len(names) > 1 else 'follows'} {camera}"


def _switches(blend: Settings, render: RenderBlock) -> Iterator[str]:
    """Yield notes on switches that are on in the dataset or in the .blend."""
    focus = bool(blend["camera"] and blend["camera"]["lens"]["depth_of_field"])
    for name, is_on, is_on_in_blend in (
        ("adaptive sampling", bool(render.adaptive_threshold), blend["adaptive_sampling"]),
        ("denoising", render.denoise, blend["denoising"]),
        ("depth of field", bool(render.depth_of_field), focus),
        ("motion blur", has_motion_blur(blend, render), blend["motion_blur"]),
    ):
        if is_on or is_on_in_blend:
            yield f"{name} {'ON' if is_on else 'off'}"


def _exposure(blend: Settings, render: RenderBlock) -> Iterator[str]:
    """Yield notes on the .blend's exposure, if anything is blurred by motion."""
    if not is_blurred(blend, render):
        return
    yield f"shutter open for {blend['shutter']:g} frames"
    if blend["camera"] and blend["camera"]["moves"]:
        yield "movement of the camera during the exposure ignored"
    if blend["shutter_position"] != "CENTER":
        yield f"shutter position {blend['shutter_position'].lower()} ignored, it is centred"
    if blend["shutter_curve"]:
        yield "shutter curve ignored"
    if blend["rolling_shutter"]:
        yield "rolling shutter ignored"


def _display(blend: Settings, uses_look: bool) -> Iterator[str]:
    """Yield notes on the .blend's changes of colours for display.

    ``uses_look`` says whether something is developed with them. Views are light in any case.
    """
    unknown = _unknown(blend)
    parts = [unknown.pop("view_transform", f"view transform {blend['view_transform']}")]
    parts += unknown.values()
    if blend["look"] != NO_LOOK:
        parts.append(f"look {blend['look']}")
    if blend["exposure"]:
        parts.append(f"view exposure {blend['exposure']:+g}")
    if blend["gamma"] != 1:
        parts.append(f"view gamma {blend['gamma']:g}")
    if blend["curves"]:
        parts.append("view curves")
    if blend.get("white"):
        parts.append("white balance")
    them = "it" if len(parts) == 1 else "them"
    use = "applied by look: file" if uses_look else f"not applied; look: file applies {them}"
    if _unknown(blend):
        use = "not applied; look: file is not possible"
    yield f"{', '.join(parts)}: {use}"


def _unknown(blend: Settings) -> dict[str, str]:
    """Return what to say of each setting for display that Blender's OpenColorIO lacks."""
    titles = {"view_transform": "view transform", "look": "look", "display": "display"}
    return {
        setting: f"{titles[setting]} {' or '.join(names)} (Blender lacks it, and has put "
        f"{blend[setting]} in its place)"
        for setting, names in blend.get("unknown", {}).items()
        if setting in titles
    }


def look_of(blend: Settings) -> dict[str, Any]:
    """Return how the .blend develops its light, as `lightfield.imaging.look` has it.

    Raises `UserError` for what would not give Blender's own pictures.
    """
    if unknown := _unknown(blend):
        raise UserError(
            f"look: file: the .blend has the {next(iter(unknown.values()))}; choose one of "
            "Blender's in its Color Management, or give look a name"
        )
    if blend["display"] != DISPLAY:
        raise UserError(
            f"look: file: the .blend's display is {blend['display']}, and PNGs are {DISPLAY}; "
            f"choose {DISPLAY} in Blender's Color Management, or give look a name"
        )
    if blend["curves"] and blend["curve_tone"] != "STANDARD":
        raise UserError(
            "look: file: the .blend's curves keep hues (Film Like), which is not possible here; "
            "choose Standard in Blender's Color Management, or give look a name"
        )
    if blend["working_space"] != REC_709 and (blend["curves"] or blend["white"]):
        raise UserError(
            f"look: file: the .blend's curves or white balance change {blend['working_space']}, "
            f"and light here is {REC_709}; give look a name"
        )
    content = {"view": blend["view_transform"], "look": blend["look"]}
    content |= {key: blend[key] for key in ("exposure", "gamma")}
    if blend["white"]:
        content["white"] = blend["white"]
    if blend["curves"]:
        content["curves"] = blend["curve_tables"]
    return content


def _film(blend: Settings, render: RenderBlock) -> Iterator[str]:
    """Yield notes on the .blend's film, units and scripts."""
    if render.transparent:
        yield "film transparent ON"
    elif blend["film_transparent"]:
        yield "film transparent on, ignored"
    if not blend["environment"]:
        yield "environment left out by the view layer, the background is black"
    if blend["pixel_aspect"] != 1:
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
    if blend["culling"]:
        yield "culling ignored"
    if "working_space" in blend.get("unknown", {}):
        yield "working space unknown, colours taken as Rec. 709"
    elif blend["working_space"] != REC_709:
        yield f"working space {blend['working_space']} converted to Rec. 709"
    if blend["unit_scale"] != 1:
        yield f"unit scale {blend['unit_scale']:g} ignored"
    if blend["scripts"]:
        yield "scripts and drivers in Python not run"


def _frames(frames: Sequence[float], file_frame: float) -> str:
    text = f"frame {frames[0]}" if len(frames) == 1 else f"frames {frames[0]} to {frames[-1]}"
    if list(frames) == [file_frame]:
        return f"{text}, the file's"
    return f"{text} (the file is at {file_frame})"


def _samples(samples: int, file_samples: int) -> str:
    text = f"{count(samples, 'sample')} a pixel"
    return (
        f"{text}, the file's"
        if samples == file_samples
        else f"{text} (the file has {file_samples})"
    )


def _missing(missing: Sequence[Settings]) -> list[str]:
    """Return a note for each kind of missing or broken file: ``2 textures missing: a.png, …``."""
    names: dict[tuple[str, str], list[str]] = {}
    for entry in missing:
        names.setdefault((entry["kind"], entry["problem"]), []).append(entry["path"])
    notes = []
    for (kind, problem), paths in names.items():
        counted_kind = _plural(kind) if len(paths) > 1 else kind
        notes.append(f"{len(paths)} {counted_kind} {problem}: {', '.join(paths)}")
    return notes


def _plural(kind: str) -> str:
    return f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
