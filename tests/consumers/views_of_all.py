"""Exports the same views in every format, and writes the places that their pixels show.

export.py calls it, and each.py reads what it writes.
"""

import shutil

import numpy as np
from sphere import LENSES, enlarged, look, write_views

from lightfield.core.files import write_json
from lightfield.engine.flags import parsed
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.exporters.instant_ngp import TransformsByHand
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.products import exports

# HCI's layout needs equal steps. No number of a pose is round.
RIG = {
    "type": "plane",
    "cameras": [3, 2],
    "baseline": 0.4,
    "center": [0.3, -0.2, 0.1],
    "rotation": [10, 20, 30],
}
CAMERA = enlarged(LENSES["perspective"], 2)
FISHEYE = enlarged(LENSES["fisheye"], 2)
# The exports of the perspective views, of the fisheyes, and of the sequence, with their options.
OF_VIEWS = {
    "coco": {"segmentation": True},
    "colmap": {"points": 2000, "depth": True},
    "dust3r": {},
    "epipolar_volumes": {"depth": True},
    "hci": {},
    "kalibr": {},
    "lichtfeld": {"points": 2000, "depth": True},
    "miv": {},
    "ncore": {"points": 2000},
    "nerf_synthetic": {},
    "nerfbaselines": {"points": 2000},
    "nerfstudio": {"points": 2000, "depth": True},
    "opendibr": {},
    "point_cloud": {"voxel": 0.1},
    "poses_csv": {},
    "splat": {"gaussians": 2000},
    "wai": {},
}
OF_FISHEYES = {"scannetpp": {"points": 2000}}
OF_SEQUENCE = {
    "colmap_frames": {"points": 2000},
    "dnerf": {"points": 2000},
    "miv_frames": {},
    "multipleview": {"points": 2000},
    "ncore_frames": {"points": 2000},
    "neural_3d_video": {"points": 2000},
    "opendibr_frames": {},
    "scene_flow": {},
}
# These need ffmpeg.
VIDEOS = ("neural_3d_video", "opendibr_frames")
# Metres that the scene of the sequence moves from one frame to the next.
MOVES = np.array([0.05, -0.02, 0.03])
FRAMES = 2


def write(folder):
    """Write the views, the places that they show, and their exports into a folder."""
    views = folder / "dataset"
    write_views(views, CAMERA, RIG)
    write_views(views / "fisheye", FISHEYE, RIG)
    write_objects(views)
    for source, formats in (("", OF_VIEWS), ("fisheye", OF_FISHEYES)):
        dataset = SourceDataset(views, source, ".exr")
        write_places(dataset, folder / f"{source or 'views'}.npz")
        for kind, options in formats.items():
            export(kind, dataset, folder, options)
    files = ["--input-cfg", views / "lightfield.json", "--output", views / "transforms.json"]
    files += ["--image-suffix", ".exr", "--image-dir", views / "exr"]
    parsed(TransformsByHand, None, [str(file) for file in files]).run()
    write_sequence(folder)


def export(kind, source, folder, options):
    settings = EXPORTERS[kind].model_validate({"sources": ["views"], **options})
    exports.run(source, settings, folder / kind)


def places(lens, matrix):
    """Return the world points (h, w, 3) that the pixels of a view show, NaN without a ray."""
    return matrix[:3, 3] + lens.pixel_rays() @ matrix[:3, :3].T * look(lens, matrix)[1][..., None]


def write_places(source, path):
    matrices = source.lightfield.world_from_cameras
    np.savez(
        path,
        names=[view.name for view in source.lightfield.views],
        matrices=matrices,
        rays=source.lens.pixel_rays(),
        points=[places(source.lens, matrix) for matrix in matrices],
    )


def write_objects(folder):
    """Write a pass of two objects, the lower and the upper half of the sphere."""
    lightfield = LightField.read(folder / "lightfield.json").changed(passes=["object"])
    lightfield.write(folder / "lightfield.json")
    for view in lightfield.views:
        height = places(lightfield.lens, view.world_from_camera)[..., 2]
        numbers = np.where(height > 0, 2, 1).astype(np.uint32)
        images.write_exr(folder / "object" / f"{view.name}.exr", {"Y": numbers})
    write_json(folder / "object" / "names.json", {"Lower": 1, "Upper": 2})


def write_sequence(folder):
    """Write views of a sphere that moves, with their passes of motion, and their exports."""
    sequence = folder / "sequence"
    for number in range(FRAMES):

        def see(lens, matrix, moved=number * MOVES):
            matrix = matrix.copy()
            matrix[:3, 3] -= moved
            return look(lens, matrix)

        write_views(sequence / "dataset", CAMERA, RIG, see=see)
        path = sequence / "dataset/lightfield.json"
        lightfield = LightField.read(path).changed(frame=number + 1, passes=["motion"])
        lightfield.write(path)
        for view in lightfield.views:
            motion = motion_of(lightfield.lens, view.world_from_camera, number * MOVES)
            images.write_exr(sequence / "dataset/motion" / f"{view.name}.exr", motion)
        (sequence / "dataset").rename(sequence / f"f{number + 1:05}")
    frames = [f"f{number + 1:05}" for number in range(FRAMES)]
    source = SourceSequence.of_folders(sequence, frames, "", ".exr", {})
    for kind, options in OF_SEQUENCE.items():
        if kind in VIDEOS and shutil.which("ffmpeg") is None:
            print(f"{kind}: is not written, because ffmpeg is not installed")
            continue
        export(kind, source, folder, options)


def motion_of(lens, matrix, moved):
    """Return the channels of the pass motion: pixels to the places in the frames around it."""
    local = matrix.copy()
    local[:3, 3] -= moved
    points = places(lens, local) + moved
    centres = np.indices(points.shape[:2])[::-1].transpose(1, 2, 0) + 0.5
    channels = {}
    for name, way in (("next", MOVES), ("previous", -MOVES)):
        pixels = lens.pixels((points + way - matrix[:3, 3]) @ matrix[:3, :3])
        motion = (pixels - centres).astype(np.float32)
        channels |= {f"{name}.{axis}": motion[..., place] for place, axis in enumerate("XY")}
    return channels
