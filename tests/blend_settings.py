"""The settings of a .blend that were tried, and what becomes of each: data for a test and a table.

tests/test_blend_settings.py renders each case by Blender itself and by Plenoforge. Run this file
to write the table in docs/reference/blend.md anew: ``python tests/blend_settings.py``.

To add a setting, add a `Case` to the row of `ROWS` that says the same of it, or add a row.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import blend_scenes as scenes
import camera_followers as followers

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "blend.md"
# The table is between these lines of the page.
BEGIN = "<!-- Written by tests/blend_settings.py. Change its rows instead. -->"
END = "<!-- End of the table. -->"

# The picture is that of Blender with the setting.
TAKEN = "taken"
# The picture is that of Blender with the setting's default.
IGNORED = "ignored"
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
    - ``format``: the file format of Blender's picture. It may concern only pictures for display.
    """

    change: Mapping[str, Any] | Callable[[], None]
    scene: Callable[[], None] = scenes.studio
    yaml: Mapping[str, Any] = field(default_factory=dict)
    by_hand: Callable[[], None] | None = None
    note: str | None = None
    outcome: str | None = None
    format: str = "OPEN_EXR"

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
        "motion blur",
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
            Case({"layer.use_motion_blur": False}, scenes.blurred_cube),
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
        "samples of the scene and of the view layer",
        IGNORED,
        [Case({"cycles.samples": 1}), Case({"layer.samples": 1})],
        "the YAML has the number",
        "`render: {samples: file}`",
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
    Row("film exposure", TAKEN, [Case({"cycles.film_exposure": 2})]),
    Row(
        "render border",
        IGNORED,
        [
            Case(
                {"render.use_border": True, "render.border_min_x": 0.5},
                note="render border ignored",
            )
        ],
    ),
]


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
