"""The settings of a .blend that were tried, and what becomes of each: data for a test and a table.

tests/rendering/test_blend_settings.py renders each case by Blender itself and by Plenoforge. Run
this file to write the table in docs/reference/blend.md anew:
``python tests/blender/blend_settings.py``.

To add a setting, add a `Case` to the row of `ROWS` that says the same of it, or add a row.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import blend_scenes as scenes
import camera_followers as followers

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "blend.md"
# The table is between these lines of the page.
BEGIN = "<!-- Written by tests/blender/blend_settings.py. Change its rows instead. -->"
END = "<!-- End of the table. -->"

# The picture is that of Blender with the setting.
TAKEN = "taken"
# The picture is that of Blender with the setting's default.
IGNORED = "ignored"
# The settings that the key look applies.
LOOK = "view transform, look, view exposure, gamma, curves, white balance"
# The scene is refused with one line.
REFUSED = "refused"


@dataclass(frozen=True)
class Case:
    """A change of a .blend that changes Blender's own picture.

    - ``change``: the new values by owner and property, as in ``{"render.use_border": True}``, or a
      function that changes the open file. `blend_scenes.roots` has the owners.
    - ``scene``: the function that makes the scene.
    - ``yaml``: blocks of the scene YAML, which are merged with the usual ones.
    - ``by_hand``: a function that gives Blender's own picture what ``yaml`` asks for. None if
      nothing is needed.
    - ``note``: a part of the note or of the error. None if nothing needs to be said.
    - ``outcome``: what becomes of the change, if it is not the row's.
    - ``since``: the version of Blender that has the setting.
    - ``format``: the file format of Blender's picture. It may concern only pictures for display.
    """

    change: Mapping[str, Any] | Callable[[], None]
    scene: Callable[[], None] = scenes.studio
    yaml: Mapping[str, Any] = field(default_factory=dict)
    by_hand: Callable[[], None] | None = None
    note: str | None = None
    outcome: str | None = None
    format: str = "OPEN_EXR"
    since: tuple[int, int] = (5, 0)

    @property
    def name(self) -> str:
        if callable(self.change):
            return self.change.__name__
        return ",".join(f"{path}={value}" for path, value in self.change.items())


@dataclass(frozen=True)
class Row:
    """A row of the table: some settings of one outcome. ``remark`` follows the outcome.

    ``key`` is the key of the scene YAML that changes the outcome, as Markdown.
    """

    settings: str
    outcome: str
    cases: list[Case]
    remark: str = ""
    key: str = ""


FILES_FRAME = {"scene": {"frame": "file"}}
CAMERA_TRAVELS = {"render": {"camera_motion": {"travel": [0.3, 0, 0]}}}

ROWS = [
    Row(
        "frame",
        IGNORED,
        [
            Case(scenes.go_between_frames, scenes.moving_cube),
            Case(
                scenes.go_between_frames,
                scenes.moving_cube,
                FILES_FRAME,
                note="frame 1.5, the file's",
                outcome=TAKEN,
            ),
        ],
        "frame 1",
        "`scene: {frame: 24}`, or `file`, which may lie between two frames",
    ),
    Row(
        "frames remapped (*Time Stretching*)",
        TAKEN,
        [
            Case({"render.frame_map_new": 50}, scenes.moving_cube, note="frames remapped"),
            Case(
                {"render.frame_map_new": 200},
                scenes.moving_cube,
                CAMERA_TRAVELS,
                by_hand=scenes.move_the_camera,
            ),
            Case(
                {"render.frame_map_new": 200},
                scenes.blurred_cube,
                CAMERA_TRAVELS,
                by_hand=scenes.move_the_camera,
            ),
        ],
    ),
    Row(
        "motion blur: on or off, how long the shutter is open, motion steps, objects without blur",
        TAKEN,
        [
            Case({"render.use_motion_blur": True}, scenes.moving_cube, note="motion blur ON"),
            Case(
                {"render.use_motion_blur": True},
                scenes.moving_cube,
                {"render": {"motion_blur": False}},
                outcome=IGNORED,
                note="motion blur off",
            ),
            Case({"render.motion_blur_shutter": 1}, scenes.blurred_cube),
            Case({"cube_cycles.use_motion_blur": False}, scenes.blurred_cube),
            Case({"cube_cycles.motion_steps": 5}, scenes.shaking_cube),
            Case({"cube_cycles.use_deform_motion": False}, scenes.growing_cube),
            Case({"layer.use_motion_blur": False}, scenes.blurred_cube),
            Case(
                {"layer.use_motion_blur": False},
                scenes.blurred_cube,
                {"render": {"motion_blur": True}},
                outcome=IGNORED,
            ),
        ],
        key="`render: {motion_blur: …}`",
    ),
    Row(
        "motion blur: position (*Start on Frame*, *End on Frame*), rolling shutter, shutter curve",
        IGNORED,
        [
            Case(
                {"render.motion_blur_position": "START"},
                scenes.blurred_cube,
                note="shutter position start ignored",
            ),
            Case(
                {"render.motion_blur_position": "END"},
                scenes.blurred_cube,
                CAMERA_TRAVELS,
                scenes.move_the_camera,
            ),
            Case(
                {"cycles.rolling_shutter_type": "TOP"}, scenes.blurred_cube, note="rolling shutter"
            ),
            Case(
                {"cycles.rolling_shutter_type": "TOP"},
                scenes.blurred_cube,
                CAMERA_TRAVELS,
                scenes.move_the_camera,
            ),
            Case(scenes.open_the_shutter_late, scenes.blurred_cube, note="shutter curve"),
            Case(
                scenes.open_the_shutter_late,
                scenes.blurred_cube,
                CAMERA_TRAVELS,
                scenes.move_the_camera,
            ),
        ],
        "the exposure is even, and its middle is at the frame, where depth is",
        "`render: {camera_motion: {rolling: …}}`",
    ),
    Row(
        "motion blur: movement of the file's camera",
        IGNORED,
        [
            Case(
                scenes.move_the_camera,
                scenes.blurred_cube,
                note="movement of the camera during the exposure ignored",
            ),
            Case(
                scenes.move_the_camera_without_blur,
                scenes.blurred_cube,
                {"render": {"motion_blur": True}},
                scenes.blur,
                note="movement of the camera during the exposure ignored",
            ),
        ],
        "a view's camera stands still",
        "`render: {camera_motion: …}`",
    ),
    Row(
        "scale of the camera, or one scale of a parent for all axes",
        TAKEN,
        [
            Case(scenes.scaled_camera),
            Case(scenes.parent_of_one_scale),
            Case(scenes.turning_twice),
        ],
        "only the place and the direction count",
    ),
    Row(
        "negative scale of the camera or of a parent",
        REFUSED,
        [
            Case(scenes.mirrored_camera, note="the camera Camera is mirrored at frame 1"),
            Case(scenes.mirroring_parent, note="the camera Camera is mirrored at frame 1"),
        ],
        "a pose cannot mirror",
    ),
    Row(
        "different scales of a parent of a turned camera, and a scale of 0",
        REFUSED,
        [
            Case(scenes.shearing_parent, note="the camera Camera is sheared or flat at frame 1"),
            Case(scenes.flat_camera, note="the camera Camera is sheared or flat at frame 1"),
        ],
        "a pose cannot shear",
    ),
    Row(
        "shadow catchers",
        TAKEN,
        [Case({"ground.is_shadow_catcher": True})],
        "with `transparent: true`, [no surface](files.md#transparency) where no shadow falls",
    ),
    Row(
        "holdouts",
        TAKEN,
        [
            Case(
                {"cube.is_holdout": True},
                yaml={"render": {"transparent": True}},
                by_hand=scenes.transparent_film,
            ),
            Case({"cube.is_holdout": True}),
        ],
        "[no surface](files.md#transparency)",
    ),
    Row(
        "constraints, drivers, parents and geometry nodes that follow the camera",
        TAKEN,
        [
            Case(followers.track_to, note="Billboard follows the file's camera in all views"),
            Case(followers.driver_of_the_scene, note="Driven follows the file's camera"),
            Case(followers.culled, note="Culled follows the file's camera"),
            Case(
                followers.active_camera,
                yaml={"scene": {"followed_camera": "view"}},
                note="Turned follows each view's camera",
            ),
        ],
        "[the file's camera, in all views](#what-follows-the-camera)",
        "`scene: {followed_camera: view}`",
    ),
    Row(
        "adaptive subdivision, and its dicing camera",
        TAKEN,
        [Case(followers.diced_for_the_view), Case(followers.diced_for_another_camera)],
        "without a dicing camera, for each view's",
    ),
    Row(
        "culling of objects by the camera or by distance (*Simplify*)",
        IGNORED,
        [
            Case(scenes.cull_by_the_camera, scenes.shaded_ground, note="culling ignored"),
            Case(scenes.cull_by_distance, scenes.shaded_ground, note="culling ignored"),
        ],
        "it would hide other objects in each view",
    ),
    Row(
        "frame rate, by seconds in geometry nodes",
        TAKEN,
        [
            Case({"render.fps": 8}, scenes.cube_at_seconds),
            Case({"render.fps_base": 3}, scenes.cube_at_seconds),
        ],
    ),
    Row("background scene", TAKEN, [Case(scenes.put_a_scene_behind)]),
    Row(
        "resolution, percentage, pixel aspect, render border with and without crop, stereoscopy",
        IGNORED,
        [
            Case({"render.resolution_x": 32}),
            Case({"render.resolution_y": 32}),
            Case({"render.resolution_percentage": 50}),
            Case({"render.pixel_aspect_x": 2}, note="pixel aspect 2 ignored"),
            Case({"render.pixel_aspect_y": 2}, note="pixel aspect 0.5 ignored"),
            Case(
                {"render.use_border": True, "render.border_min_x": 0.5},
                note="render border ignored",
            ),
            Case({"render.use_border": True, "render.border_max_x": 0.5}),
            Case({"render.use_border": True, "render.border_min_y": 0.5}),
            Case({"render.use_border": True, "render.border_max_y": 0.5}),
            Case(
                {
                    "render.use_border": True,
                    "render.border_max_x": 0.5,
                    "render.use_crop_to_border": True,
                }
            ),
            Case({"render.use_multiview": True}, note="stereoscopy ignored"),
        ],
        "the YAML has the resolution, and pixels are square",
        "`camera` of a rig, `stereo` of a rig",
    ),
    Row(
        "film transparent",
        IGNORED,
        [
            Case({"render.film_transparent": True}, note="film transparent on, ignored"),
            Case(
                {"render.film_transparent": True},
                yaml={"render": {"transparent": True}},
                note="film transparent ON",
                outcome=TAKEN,
            ),
        ],
        "the world is seen",
        "`render: {transparent: true}`",
    ),
    Row(
        "glass on a transparent film",
        TAKEN,
        [
            Case(
                {"cycles.film_transparent_glass": True},
                yaml={"render": {"transparent": True}},
                by_hand=scenes.transparent_film,
            ),
            Case(
                {"cycles.film_transparent_roughness": 0},
                scenes.clear_glass,
                yaml={"render": {"transparent": True}},
                by_hand=scenes.transparent_film,
            ),
        ],
    ),
    Row(
        "compositor, sequencer",
        IGNORED,
        [
            Case(scenes.invert_in_the_compositor, note="compositor ignored"),
            Case(scenes.cut_to_a_colour_strip, note="sequencer ignored"),
        ],
    ),
    Row("stamp", IGNORED, [Case(scenes.burn_a_stamp, format="PNG")]),
    Row(
        LOOK,
        IGNORED,
        [
            Case({"view.view_transform": "Raw"}, note="view transform Raw: not", format="PNG"),
            Case({"view.look": "AgX - High Contrast"}, note="look AgX - High", format="PNG"),
            Case({"view.exposure": 2}, note="view exposure +2: not applied; look: ", format="PNG"),
            Case({"view.gamma": 2}, note="view gamma 2: not applied; look: ", format="PNG"),
            Case(
                {"view.use_white_balance": True, "view.white_balance_temperature": 3000},
                note="white balance: not applied; look: ",
                format="PNG",
            ),
            Case({"view.use_white_balance": True, "view.white_balance_tint": 90}, format="PNG"),
            Case(scenes.bend_the_curve, note="view curves: not applied; look: ", format="PNG"),
        ],
        "views are scene-linear",
        "[`look: file`](../how-to/keep-the-look.md) of a reprojection, an export or the sensor",
    ),
    Row(
        "samples of the scene and of the view layer",
        IGNORED,
        [
            Case({"cycles.samples": 1}, note="4 samples a pixel (the file has 1)"),
            Case({"layer.samples": 1}),
            Case({"cycles.use_sample_subset": True, "cycles.sample_offset": 2}),
            Case({"cycles.use_sample_subset": True, "cycles.sample_subset_length": 1}),
            Case(
                {"cycles.samples": 1},
                yaml={"render": {"samples": "file"}},
                note="1 sample a pixel, the file's",
                outcome=TAKEN,
            ),
        ],
        "the YAML has the number",
        "`render: {samples: file}`",
    ),
    Row(
        "seed",
        IGNORED,
        [Case({"cycles.seed": 5}), Case({"cycles.use_animated_seed": True})],
        "each view has its own",
        "`render: {seed: …}`",
    ),
    Row(
        "adaptive sampling, denoising, and their settings",
        IGNORED,
        [
            Case(
                scenes.stop_early,
                scenes.many_samples,
                {"render": {"samples": 32}},
                note="adaptive sampling off",
            ),
            Case(scenes.denoise, note="denoising off"),
            Case(
                scenes.stop_early,
                scenes.many_samples,
                {"render": {"samples": 32, "adaptive_threshold": 0.5}},
                outcome=TAKEN,
                note="adaptive sampling ON",
            ),
            Case(
                {"cycles.denoising_input_passes": "RGB"},
                scenes.denoised,
                {"render": {"denoise": True}},
            ),
            Case(
                {"layer_cycles.use_denoising": False},
                scenes.denoised,
                {"render": {"denoise": True}},
                note="denoising ON",
            ),
        ],
        "off",
        "`render: {adaptive_threshold: …, denoise: true}`",
    ),
    Row(
        "sampling: pattern, scrambling distance, light threshold, light tree, path guiding",
        TAKEN,
        [
            Case({"cycles.sampling_pattern": "BLUE_NOISE"}, scenes.tabulated_noise),
            Case({"cycles.scrambling_distance": 0.3}, scenes.tabulated_noise),
            Case({"cycles.use_light_tree": False}),
            Case({"cycles.use_light_tree": False, "cycles.light_sampling_threshold": 0.9}),
            Case({"cycles.use_guiding": True}),
        ],
        key="`render: {light_tree: …, guiding: …}`",
    ),
    Row(
        "light paths: bounces of all kinds, clamping, caustics, filter glossy, fast global "
        "illumination",
        TAKEN,
        [
            Case({"cycles.max_bounces": 1}),
            Case({"cycles.diffuse_bounces": 0}),
            Case({"cycles.glossy_bounces": 0}),
            Case({"cycles.transmission_bounces": 1}),
            Case({"cycles.volume_bounces": 3}, scenes.fog),
            Case({"cycles.transparent_max_bounces": 0}, scenes.leaves),
            Case({"cycles.min_light_bounces": 4}),
            Case({"cycles.min_transparent_bounces": 4}, scenes.leaves),
            Case({"cycles.sample_clamp_direct": 0.2}),
            Case({"cycles.sample_clamp_indirect": 0.1}),
            Case({"cycles.caustics_reflective": False}),
            Case({"cycles.caustics_refractive": False}),
            Case({"cycles.blur_glossy": 10}),
            Case({"cycles.use_fast_gi": True}),
            Case({"cycles.use_fast_gi": True, "cycles.fast_gi_method": "ADD"}),
            Case({"cycles.use_fast_gi": True, "cycles.ao_bounces_render": 2}),
            Case({"cycles.use_fast_gi": True, "world_ambient.ao_factor": 0.1}),
            Case({"cycles.use_fast_gi": True, "world_ambient.distance": 1}),
        ],
        key="`render: {max_bounces: …, clamp_indirect: …}`",
    ),
    Row(
        "volumes: step rate, most steps",
        TAKEN,
        [
            Case({"cycles.volume_step_rate": 10}, scenes.fog),
            Case({"cycles.volume_max_steps": 2}, scenes.fog),
        ],
    ),
    Row(
        "film exposure, pixel filter, filter width",
        TAKEN,
        [
            Case({"cycles.film_exposure": 2}),
            Case({"cycles.pixel_filter_type": "BOX"}),
            Case({"cycles.pixel_filter_type": "GAUSSIAN"}),
            Case({"cycles.filter_width": 5}),
        ],
        key="`render: {filter_width: …}`",
    ),
    Row(
        "pixel jitter",
        IGNORED,
        [Case({"cycles.use_pixel_jitter": True}, since=(5, 2))],
        "depth is at the centres of pixels",
    ),
    Row(
        "adaptive subdivision: dicing rate, most subdivisions",
        TAKEN,
        [
            Case({"cycles.dicing_rate": 20}, scenes.waves),
            Case({"cycles.max_subdivisions": 1}, scenes.waves),
        ],
    ),
    Row(
        "Simplify",
        TAKEN,
        [
            Case(
                {"render.use_simplify": True, "render.simplify_subdivision_render": 0},
                scenes.rounded_cube,
                note="simplify ON",
            ),
            Case(
                {"render.use_simplify": True, "render.simplify_child_particles_render": 0},
                scenes.particle_hair,
            ),
            Case(
                {"render.use_simplify": True, "cycles.texture_limit_render": "128"},
                scenes.textured_cube,
            ),
        ],
    ),
    Row(
        "hair: shape, subdivisions, children",
        TAKEN,
        [
            Case({"curves.shape": "THICK"}, scenes.hairy_cube),
            Case({"curves.shape": "THICK_LINEAR"}, scenes.hairy_cube),
            Case({"curves.subdivisions": 0}, scenes.hairy_cube),
            Case({"layer.use_strand": False}, scenes.particle_hair),
        ],
    ),
    Row(
        "view layer: collections shown, as holdout, and for indirect light only; overrides",
        TAKEN,
        [
            Case({"layer_collection.exclude": True}),
            Case({"layer_collection.holdout": True}),
            Case({"layer_collection.indirect_only": True}),
            Case(scenes.add_a_layer_without_the_bodies, note="view layer Second of 2"),
            Case(scenes.override_the_materials),
            Case(scenes.override_the_world),
            Case({"layer.use_solid": False}),
        ],
        key="`scene: {view_layers: [Main, Stage]}`",
    ),
    Row(
        "environment that the view layer leaves out",
        TAKEN,
        [Case({"layer.use_sky": False}, note="environment left out by the view layer")],
        "the background is black",
    ),
    Row(
        "camera: focal length, sensor, shift",
        TAKEN,
        [
            Case({"camera.lens": 30}, note="camera Camera (30 mm) taken"),
            Case({"camera.sensor_width": 24}),
            Case({"camera.sensor_fit": "VERTICAL", "camera.sensor_height": 36}),
            Case({"camera.sensor_fit": "VERTICAL"}),
            Case({"camera.shift_x": 0.2}),
            Case({"camera.shift_y": 0.2}),
            Case({"camera.angle": 0.4}),
            Case({"camera.angle_x": 0.4}),
            Case({"camera.angle_y": 0.4}),
        ],
        "with `lens: file` of a rig of type `blend_camera`",
        "`camera` of the rig",
    ),
    Row(
        "camera: orthographic, panoramic",
        REFUSED,
        [
            Case({"camera.type": "ORTHO"}, note="is not a perspective one"),
            Case({"camera.type": "PANO"}, note="is not a perspective one"),
        ],
        "with `lens: file`",
        "`camera` of the rig",
    ),
    Row(
        "clip planes of the camera",
        IGNORED,
        [
            Case({"camera.clip_start": 5}, note="clip planes at 5 and"),
            Case({"camera.clip_end": 5}, note="and 5 m ignored"),
        ],
        "nothing is cut away",
    ),
    Row(
        "depth of field",
        IGNORED,
        [
            Case({"focus.use_dof": True, "focus.aperture_fstop": 0.1}, note="depth of field off"),
            *(
                Case(change, scenes.focused, {"render": {"depth_of_field": True}}, outcome=TAKEN)
                for change in (
                    {"focus.aperture_fstop": 0.3},
                    {"focus.focus_distance": 6},
                    {"focus.aperture_ratio": 2},
                    {"focus.aperture_blades": 3},
                    {"focus.aperture_blades": 3, "focus.aperture_rotation": 1},
                    scenes.focus_on_the_chrome,
                )
            ),
        ],
        "everything is sharp",
        "`render: {depth_of_field: true}`",
    ),
    Row(
        "world: colour, sampling, bounces, rays that see it",
        TAKEN,
        [
            Case({"world_cycles.sampling_method": "NONE"}, scenes.textured_world),
            Case(
                {"world_cycles.sampling_method": "MANUAL", "world_cycles.sample_map_resolution": 8},
                scenes.textured_world,
            ),
            Case({"world_visibility.camera": False}),
            Case({"world_visibility.diffuse": False}),
            Case({"world_visibility.glossy": False}),
            Case({"world_visibility.transmission": False}),
            Case({"world_visibility.scatter": False}, scenes.fog),
        ],
    ),
    Row(
        "lights: type, colour, temperature, strength, size, bounces, shadow, sampling, portal, "
        "linking",
        TAKEN,
        [
            Case({"lamp.type": "SPOT"}),
            Case({"lamp.color": (1, 0, 0)}),
            Case({"lamp.use_temperature": True, "lamp.temperature": 2000}),
            Case({"lamp.energy": 50}),
            Case({"lamp.exposure": 1}),
            Case({"lamp.normalize": False}),
            Case({"lamp.shadow_soft_size": 1}),
            Case({"lamp.use_shadow": False}),
            Case({"lamp_cycles.max_bounces": 0}),
            Case({"lamp_cycles.use_multiple_importance_sampling": False}, scenes.area_lamp),
            Case({"lamp_cycles.is_portal": True}, scenes.area_lamp),
            Case({"lamp.shape": "DISK"}, scenes.area_lamp),
            Case({"lamp.size": 0.5}, scenes.area_lamp),
            Case({"lamp.spread": 0.5}, scenes.area_lamp),
            Case({"lamp.spot_size": 0.5}, scenes.spotlight),
            Case({"lamp.spot_blend": 1}, scenes.spotlight),
            Case({"lamp_object.visible_diffuse": False}),
            Case(scenes.link_the_lamp_to_the_ground),
            Case(scenes.block_the_lamp_by_nothing),
        ],
    ),
    Row(
        "objects: place, hidden in renders, rays that see them, colour, shading at edges",
        TAKEN,
        [
            Case({"cube.hide_render": True}),
            Case({"collection.hide_render": True}),
            Case({"cube.visible_camera": False}),
            Case({"cube.visible_diffuse": False}),
            Case({"chrome.visible_glossy": False}),
            Case({"cube.visible_glossy": False}),
            Case({"ground.visible_transmission": False}),
            Case({"ground.visible_volume_scatter": False}, scenes.fog),
            Case({"cube.visible_shadow": False}),
            Case({"cube.color": (0, 1, 0, 1)}, scenes.tinted_cube),
            Case({"cube.location": (0.5, 0, 0)}),
            Case({"cube.delta_location": (0.5, 0, 0)}),
            Case({"cube.shadow_terminator_shading_offset": 1}, scenes.rounded_cube),
            Case(scenes.hide_the_round_in_renders, scenes.rounded_cube),
        ],
    ),
    Row(
        "instances: of collections, on vertices and faces, shown instancers",
        TAKEN,
        [
            Case({"collection.instance_offset": (1, 0, 0)}, scenes.instances),
            Case({"cube.instance_type": "VERTS"}, scenes.balls_on_faces),
            Case(
                {"cube.use_instance_faces_scale": True, "cube.instance_faces_scale": 2},
                scenes.balls_on_faces,
            ),
            Case({"cube.show_instancer_for_render": False}, scenes.balls_on_faces),
        ],
    ),
    Row(
        "materials: displacement, bump correction, sampling of glow and volumes",
        TAKEN,
        [
            Case({"material.displacement_method": "DISPLACEMENT"}, scenes.bumpy_cube),
            Case({"material_cycles.use_bump_map_correction": False}, scenes.bumpy_cube),
            Case({"material_cycles.emission_sampling": "NONE"}, scenes.glowing_cube),
            Case({"material.use_transparent_shadow": False}, scenes.leaves),
            Case({"fog_cycles.volume_sampling": "DISTANCE"}, scenes.fog),
            Case({"fog_cycles.volume_step_rate": 10}, scenes.fog),
        ],
    ),
]

# The owners of `blend_scenes.roots` whose properties are accounted for.
OWNERS = [
    "scene",
    "render",
    "cycles",
    "curves",
    "view",
    "layer",
    "layer_cycles",
    "layer_collection",
    "collection",
    "camera",
    "focus",
    "world",
    "world_cycles",
    "world_visibility",
    "cube",
    "cube_cycles",
    "lamp",
    "lamp_cycles",
    "material",
    "material_cycles",
]
# Those of their properties that no case sets by name, by what they are, as patterns.
NO_CASE = {
    "names, and what Blender keeps of each data-block": """
        *.name *.use_fake_user *.use_extra_user *.is_runtime_data *.tag *.asset_data *.use_nodes
        *.active_* *.paint_* *.lock_* *.lineart_* *.line_* *.use_lineart_*""",
    "set by a function of blend_scenes or camera_followers": """
        scene.background_set scene.camera scene.world scene.frame_* scene.compositing_node_group
        render.frame_map_old render.use_stamp* render.stamp_* layer.material_override
        layer.world_override layer.use cycles.use_denoising cycles.use_adaptive_sampling
        cycles.adaptive_* cycles.use_*_cull cycles.*_cull_margin cycles.dicing_camera
        cycles.denoising_prefilter cycles.denoising_quality view.use_curve_mapping
        focus.focus_object cube_cycles.use_*_cull cube.instance_collection scene.use_stamp_note
        cycles.volume_biased""",
    "about time line, sound, simulation or annotations": """
        scene.time_jump_* scene.lock_* scene.allow_preroll scene.use_preview_range
        scene.show_* scene.*simulation* scene.sync_mode scene.playback_loop_mode scene.*gravity
        scene.use_audio* scene.audio_* scene.annotation scene.active_clip""",
    "about the viewport, EEVEE, Freestyle, Grease Pencil, baking, or the user interface": """
        render.preview_* cycles.*preview* cycles.bake_type render.*gpencil* render.use_freestyle
        layer.use_freestyle layer.*grease_pencil render.hair_* render.line_thickness*
        render.use_high_quality_normals render.anisotropic_filter render.sequencer_gl_preview
        render.use_sequencer_override_scene_strip render.simplify_subdivision
        render.simplify_child_particles render.use_simplify_normals cycles.texture_resolution
        cycles.texture_limit cycles.ao_bounces *.hide_viewport *.hide_select collection.color_tag
        camera.show_* camera.composition_* camera.display_size camera.passepartout_alpha
        camera.lens_unit world.color world.use_eevee_* world.sun_* world.use_sun_*
        world.probe_resolution lamp.shadow_* lamp.use_shadow_jitter lamp.*_factor
        lamp.use_custom_distance lamp.cutoff_distance lamp.use_absolute_resolution
        lamp_cycles.use_shadow material.surface_render_method material.blend_method
        material.alpha_threshold material.use_transparency_overlap material.show_*
        material.preview_* material.use_preview_world material.use_backface_*
        material.use_*_refraction
        material.use_sss_translucency material.refraction_depth material.*thickness*
        material.volume_intersection_method material.diffuse_color material.specular_*
        material.roughness material.metallic *.show_in_front *.show_* *.display_* cube.hide_probe_*
        cube.hide_surface_pick cube.empty_* cube.use_empty_* cube.use_mesh_mirror_*
        cube.use_grease_* cube.use_shape_key_edit_mode layer.use_ao layer.use_volumes""",
    "about the files and passes that Blender writes, memory, and speed": """
        render.threads* render.use_placeholder render.use_overwrite render.save_output
        render.use_compositing render.use_sequencer render.use_file_extension
        render.use_lock_interface render.filepath render.use_render_cache render.metadata_input
        render.use_single_layer render.views_format render.engine render.use_*texture_cache
        render.use_persistent_data render.compositor_* render.ppm_* render.dither_intensity
        render.filter_size cycles.device cycles.shading_system cycles.denoiser
        cycles.denoising_use_gpu cycles.time_limit cycles.use_layer_samples cycles.debug_*
        cycles.use_auto_tile cycles.tile_size cycles.direct_light_sampling_type layer.*pass_*
        layer_cycles.*pass_* layer_cycles.denoising_store_passes *.lightgroup
        cycles.auto_scrambling_distance""",
    "about lenses that `lens: file` refuses, and the view transform's white": """
        camera.ortho_scale camera.panorama_type camera.fisheye_* camera.latitude_*
        camera.longitude_* camera.central_* camera.custom_* focus.focus_subtarget
        view.white_balance_whitepoint""",
    "the place and shape of objects, as a material can read it": """
        cube.data cube.parent* cube.use_parent_final_indices cube.use_camera_lock_parent
        cube.track_axis cube.up_axis cube.rotation_* cube.scale cube.dimensions cube.delta_*
        cube.matrix_* cube.add_rest_position_attribute cube.use_simulation_cache
        cube.use_instance_vertices_rotation *.pass_index material.max_vertex_displacement""",
    "like another that has a case, or of too little effect in a small scene": """
        cycles.use_deterministic_guiding cycles.guiding_* cycles.use_*guiding* cycles.*guiding_*
        cycles.offscreen_dicing_scale cycles.rolling_shutter_duration
        cycles.texture_resolution_render render.simplify_volumes *_cycles.is_caustics_*
        world_cycles.max_bounces world_cycles.volume_* world_cycles.use_shadows
        world_visibility.shadow cube.visible_* cube.is_shadow_catcher cube.shadow_terminator_*
        cube_cycles.shadow_terminator_* cube_cycles.ao_distance lamp.use_soft_falloff
        lamp.use_square material_cycles.volume_*""",
}


def table() -> str:
    """Return the table of the rows, as Markdown."""
    lines = [
        "| setting of the file | what becomes of it | key that changes it |",
        "| --- " * 3 + "|",
    ]
    for row in ROWS:
        remark = f": {row.remark}" if row.remark else ""
        lines.append(f"| {row.settings} | {row.outcome}{remark} | {row.key} |")
    return "\n".join(lines)


def page(text: str) -> str:
    """Return the text of the page with the present table."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
