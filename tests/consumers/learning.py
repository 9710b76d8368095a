"""Checks that a small radiance field learns from an export what it shows, as nerfstudio reads it.

A field is learned from the views as they are, and from views of which one thing is read wrongly:
the poses, or the images' left and right. At held-out rays the first must be clearly better. Steps
and seeds are the same.
"""

from typing import NamedTuple

import cv2
import numpy as np
import torch
from radiance_field import Field

TRUE = "as exported"
SHUFFLED = "shuffled poses"
MIRRORED = "mirrored images"
RAYS = 2048
STEPS = 60
RATE = 1e-2
LAST_RATE = 1e-3
# Held-out rays at which a field is evaluated.
EVALUATED = 1000
# By so many decibels the views as exported must be better.
MARGIN = 5


class Pixels(NamedTuple):
    """Pixels of views: origins and unit rays (n, 3), colours (n, 3) from 0 to 1, metres (n,)."""

    origins: np.ndarray
    rays: np.ndarray
    colours: np.ndarray
    distance: np.ndarray


def read(outputs, reading):
    """Return the pixels of the views of one of nerfstudio's parts."""
    poses = np.arange(len(outputs.image_filenames))
    if reading == SHUFFLED:
        poses = np.random.default_rng(1).permutation(poses)
    views = [_read_view(outputs, index, pose, reading) for index, pose in enumerate(poses)]
    return Pixels(*(np.concatenate(parts).astype(np.float32) for parts in zip(*views, strict=True)))


def _read_view(outputs, index, pose, reading):
    """Return the pixels of a view, seen from the pose of the view ``pose``."""
    colour = cv2.imread(str(outputs.image_filenames[index]))[..., ::-1] / 255
    depth = cv2.imread(str(outputs.metadata["depth_filenames"][index]), cv2.IMREAD_ANYDEPTH)
    depth = depth * outputs.metadata["depth_unit_scale_factor"]
    valid = np.ones(depth.shape, bool)
    if outputs.mask_filenames:
        valid = cv2.imread(str(outputs.mask_filenames[index]), cv2.IMREAD_GRAYSCALE) > 0
    if reading == MIRRORED:
        colour, depth, valid = (part[:, ::-1] for part in (colour, depth, valid))
    bundle = outputs.cameras.generate_rays(camera_indices=int(pose))
    rays = bundle.directions.numpy()
    # Scale as nerfstudio's datasets do: depth is along the axis, so rays are longer than 1.
    length = bundle.metadata["directions_norm"].numpy()[..., 0]
    distance = np.where(depth > 0, depth * length, np.inf)
    return bundle.origins.numpy()[valid], rays[valid], colour[valid], distance[valid]


def learn(train, test):
    """Return the PSNR in decibel at rays of ``test`` of a field that learns from ``train``."""
    torch.manual_seed(0)
    centers = np.unique(train.origins, axis=0)
    center = centers.mean(axis=0)
    radius = float(np.linalg.norm(centers - center, axis=1).max())
    field = Field(torch.tensor(center), radius)
    optimizer = torch.optim.Adam(field.parameters(), RATE, betas=(0.9, 0.99), eps=1e-12)
    decay = (LAST_RATE / RATE) ** (1 / STEPS)
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, decay)
    pixels = [torch.from_numpy(part) for part in train]
    for _ in range(STEPS):
        chosen = torch.randint(len(train.rays), (RAYS,))
        optimizer.zero_grad()
        field.loss(*(part[chosen] for part in pixels)).backward()
        optimizer.step()
        schedule.step()
    chosen = np.random.default_rng(2).integers(0, len(test.rays), EVALUATED)
    origins, rays, colours, _ = (torch.from_numpy(part[chosen]) for part in test)
    error = field.render(origins, rays) - colours
    return -10 * float((error**2).mean().log10())


def check(parser):
    """Check an export that nerfstudio's ``parser`` reads."""
    parts = [parser.get_dataparser_outputs(part) for part in ("train", "test")]
    psnr = {
        reading: learn(*(read(part, reading) for part in parts))
        for reading in (TRUE, SHUFFLED, MIRRORED)
    }
    described = ", ".join(f"{value:.1f} dB {reading}" for reading, value in psnr.items())
    print(f"torch {torch.__version__}: a radiance field shows held-out rays with {described}")
    true = psnr.pop(TRUE)
    assert true > max(psnr.values()) + MARGIN
