"""Makes Cycles render through a lens that it lacks, by a shader of the camera.

The shader holds `lightfield.geometry.ray_table`, so no lens has an equation here. Its byte code
differs between versions and folders of Blender. So it is in no file: the lens itself says what the
views show. On GPUs, Cycles runs shaders of cameras with OptiX alone.
"""

import hashlib
from collections.abc import Iterable
from importlib import import_module
from typing import Any

import bpy
import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.leftovers import temporary_folder
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.base import RadialLens, slack
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.ray_table import BEND_INTERVALS, INTERVALS, MARGIN, RayTable, ray_table
from lightfield.imaging import images
from lightfield.rendering.scenes.quiet import quiet

Array = np.ndarray[Any, Any]

# The only kind of GPU on which Cycles runs shaders of cameras.
GPU = "OPTIX"
# The longer side in pixels of the image that tells whether the shader works.
_TESTED_SIDE = 32

# The camera of a shader looks along +Z, and +Y is up. The corners of the raster are 0 and 1. Cycles
# skips rays without throughput. The aperture's place is 0 without depth of field. It is in units of
# the focal length, which Cycles does not pass on.
_SHADER = """
void weigh(float at, int intervals, output int first, output float weights[4])
{{
    first = clamp(int(at), 0, intervals - 1);
    float s = at - first;
    float t = 1 - s;
    weights[0] = t * t * t / 6;
    weights[1] = (4 - 6 * s * s + 3 * s * s * s) / 6;
    weights[2] = (4 - 6 * t * t + 3 * t * t * t) / 6;
    weights[3] = s * s * s / 6;
}}

shader lens(
    float angles[{angles_count}] = {{{angles}}},
    {bend_array}
    float focal_length = 0,
    output point position = 0, output vector direction = 0, output color throughput = 0)
{{
    point raster = camera_shader_raster_position();
    float x = (raster[0] - {center_x!r}) * {across!r};
    float y = (raster[1] - {center_y!r}) * {up!r};
    {bend}
    float r = sqrt(x * x + y * y);
    if (r <= {limit!r}) {{
        int first;
        float weights[4];
        weigh((1 - sqrt(max(1 - r, 0))) * {intervals}, {intervals}, first, weights);
        float theta = 0;
        for (int i = 0; i < 4; i++)
            theta += weights[i] * angles[first + i];
        float scale = r > 0 ? sin(theta) / r : 0;
        direction = vector(scale * x, scale * y, cos(theta));
        throughput = 1;
        point aperture = 0;
        getattribute("cam:aperture_position", aperture);
        if (aperture != 0) {{
            float focal_distance = 0;
            getattribute("cam:focal_distance", focal_distance);
            aperture *= focal_length;
            {focus}
            direction = normalize(direction - position);
        }}
    }}
}}
"""

_BEND_ARRAY = "float bend[{count}] = {{{bend}}},"
# The columns and rows of the bend also cover a margin around the image.
_BEND = """
    int left;
    int low;
    float across[4];
    float up[4];
    weigh((raster[0] + {margin_x!r}) * {columns!r}, {intervals}, left, across);
    weigh((raster[1] + {margin_y!r}) * {rows!r}, {intervals}, low, up);
    for (int i = 0; i < 4; i++) {{
        for (int j = 0; j < 4; j++) {{
            int entry = 2 * ((low + i) * ({intervals} + 3) + left + j);
            x += up[i] * across[j] * bend[entry];
            y += up[i] * across[j] * bend[entry + 1];
        }}
    }}
"""

# As Cycles' perspective camera: the aperture is a disc, and what is in focus is a plane.
_PLANE = """
            position = aperture;
            direction *= focal_distance / max(direction[2], 1e-6);
"""
# As Cycles' panoramas: the aperture is a disc across the ray, and what is in focus is a sphere.
_SPHERE = """
            vector side = normalize(vector(0, 0, 1) - direction[2] * direction);
            position = aperture[0] * side + aperture[1] * normalize(cross(side, direction));
            direction *= focal_distance;
"""


def see_through(camera: Any, lens: RadialLens) -> None:
    """Make a camera of Blender see through a lens.

    Raises `UserError` if Blender cannot compile the shader, or if Cycles cannot run it.
    """
    code = _compiled(_source(lens))
    camera.type = "CUSTOM"
    camera.custom_mode = "INTERNAL"
    camera.custom_bytecode = code
    camera.custom_bytecode_hash = hashlib.md5(code.encode(), usedforsecurity=False).hexdigest()
    small = lens.fitted(_TESTED_SIDE)
    has_ray = np.isfinite(small.pixel_rays()[..., 0])
    if has_ray.any() and not _sees(camera, small)[has_ray].any():
        raise UserError("camera: Cycles cannot run the shader of the lens")


def set_focal_length(camera: Any, lens: RadialLens, millimetres: float) -> None:
    """Give the shader of a camera the focal length, from which the aperture's width follows.

    A perspective lens has its own. For others it is the artist's, as for Cycles' own lenses.
    """
    if isinstance(lens, Rectilinear | CalibratedLens) and lens.focuses_on_plane:
        millimetres = lens.focal_length
    camera.cycles_custom["focal_length"] = millimetres / 1000


def _source(lens: RadialLens) -> str:
    """Return the source of a lens's shader."""
    table = ray_table(lens)
    width, height = lens.width, lens.height
    bends = table.bend is not None
    return _SHADER.format(
        angles_count=table.angles.size,
        angles=_listed(table.angles),
        bend_array=_bend_array(table),
        center_x=lens.center[0] / width,
        center_y=1 - lens.center[1] / height,
        across=width * lens._unit[0] / table.reach,
        up=height * lens._unit[1] / table.reach,
        bend=_bend(lens) if bends else "",
        limit=slack(np.dtype(np.float32)),
        intervals=INTERVALS,
        focus=_PLANE if lens.focuses_on_plane and table.is_ahead else _SPHERE,
    )


def _bend_array(table: RayTable) -> str:
    if table.bend is None:
        return ""
    return _BEND_ARRAY.format(count=table.bend.size, bend=_listed(table.bend.ravel()))


def _bend(lens: RadialLens) -> str:
    """Return the part of the shader that moves a point where the lens is not radial."""
    return _BEND.format(
        margin_x=MARGIN / lens.width,
        margin_y=MARGIN / lens.height,
        columns=BEND_INTERVALS / (1 + 2 * MARGIN / lens.width),
        rows=BEND_INTERVALS / (1 + 2 * MARGIN / lens.height),
        intervals=BEND_INTERVALS,
    )


def _listed(numbers: Iterable[float]) -> str:
    # Nine digits are enough for a float32.
    return ", ".join(f"{number:.9g}" for number in numbers)


def _compiled(source: str) -> str:
    """Return the byte code of a shader. Blender's own operator needs packages that bpy lacks."""
    with temporary_folder() as folder:
        text, code = folder / "lens.osl", folder / "lens.oso"
        text.write_text(source, encoding="utf-8")
        with quiet():
            is_compiled = import_module("_cycles").osl_compile(str(text), str(code))
        if not is_compiled:
            raise UserError("camera: Blender cannot compile the shader of the lens")
        return code.read_text(encoding="utf-8")


def _sees(camera: Any, lens: Lens) -> Array:
    """Return which pixels (height, width) of a camera have a ray, by a render of an empty scene.

    Cycles renders black without an error if it cannot run a shader. A ray that hits nothing has no
    alpha, and a pixel without a ray is opaque.
    """
    scene = bpy.data.scenes.new("plenoforge_lens_test")
    camera_object = bpy.data.objects.new("plenoforge_lens_test", camera)
    scene.collection.objects.link(camera_object)
    scene.camera = camera_object
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = lens.width
    render.resolution_y = lens.height
    render.film_transparent = True
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    try:
        with temporary_folder() as folder, quiet():
            render.filepath = str(folder / "view.exr")
            bpy.ops.render.render(write_still=True, scene=scene.name)
            alpha = images.read_image(render.filepath).channels["A"]
    finally:
        bpy.data.objects.remove(camera_object)
        bpy.data.scenes.remove(scene)
    return np.asarray(alpha < 0.5)
