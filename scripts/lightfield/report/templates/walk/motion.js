// How the eye moves: by keys, pointers and the wheel.

import { along, clamp } from "../page/vectors.js";
import { drawWalkSoon } from "./drawing.js";
import { STEEPEST_PITCH, axes, insideVolume } from "./eye.js";
import { walk } from "./state.js";

// Move the eye by parts of the rig's extent: on the level ahead, sideways, and upwards.
export function moved(forward, sideways, upwards) {
  const [right] = axes();
  const level = [-Math.sin(walk.yaw), Math.cos(walk.yaw), 0];
  const way = [0, 1, 2].map((axis) => forward * level[axis] + sideways * right[axis] + (axis === 2 ? upwards : 0));
  walk.at = insideVolume(along(walk.at, way, walk.extent));
  drawWalkSoon();
}

// Turn the eye, by radians.
export function turned(x, y) {
  walk.yaw -= x;
  walk.pitch = clamp(walk.pitch - y, -STEEPEST_PITCH, STEEPEST_PITCH);
  drawWalkSoon();
}

// What each key adds to `moved`, and to `turned`.
export const WALKING = {
  w: [1, 0, 0],
  s: [-1, 0, 0],
  a: [0, -1, 0],
  d: [0, 1, 0],
  e: [0, 0, 1],
  q: [0, 0, -1],
  ArrowUp: [1, 0, 0],
  ArrowDown: [-1, 0, 0],
};
export const TURNING = { ArrowLeft: [-1, 0], ArrowRight: [1, 0] };

// What each key multiplies the zoom by, in a second.
export const ZOOMING = { "+": 2, "=": 2, "-": 0.5 };

// Enlarge the picture, between the default field of view and an eighth of it.
export function zoomed(factor) {
  walk.zoom = clamp(factor * walk.zoom, 1, 8);
  drawWalkSoon();
}

// Move in each frame, for as long as a key is held.
export function walkOn(before) {
  requestAnimationFrame((now) => {
    const seconds = clamp((now - before) / 1000, 0, 0.1);
    for (const key of walk.keys) {
      if (key in WALKING) moved(...WALKING[key].map((value) => 0.6 * seconds * value));
      else if (key in ZOOMING) zoomed(ZOOMING[key] ** seconds);
      else turned(...TURNING[key].map((value) => 1.2 * seconds * value));
    }
    if (walk.keys.size) walkOn(now);
  });
}
