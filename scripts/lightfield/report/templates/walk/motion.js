// Moves the eye: by keys, pointers and the wheel.

import { along, clamp } from "../page/vectors.js";
import { drawWalkSoon } from "./drawing.js";
import { STEEPEST_PITCH, axes, insideVolume, leastZoom } from "./eye.js";
import { walk } from "./state.js";

// Move the eye forward, sideways and upwards, in parts of the rig's extent. Forward and sideways are level.
export function moveEye(forward, sideways, upwards) {
  const [right] = axes();
  const level = [-Math.sin(walk.yaw), Math.cos(walk.yaw), 0];
  const offset = [0, 1, 2].map((axis) => forward * level[axis] + sideways * right[axis] + (axis === 2 ? upwards : 0));
  walk.at = insideVolume(along(walk.at, offset, walk.extent));
  drawWalkSoon();
}

// Turn the eye, by radians.
export function turnEye(x, y) {
  walk.yaw -= x;
  walk.pitch = clamp(walk.pitch - y, -STEEPEST_PITCH, STEEPEST_PITCH);
  drawWalkSoon();
}

// The arguments of `moveEye` and of `turnEye` for each key, before the factor of time.
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

// The factor by which each key changes the zoom in a second.
export const ZOOMING = { "+": 2, "=": 2, "-": 0.5 };

// Enlarge the picture: from the widest field of view to an eighth of the default one.
export function zoomBy(factor) {
  walk.zoom = clamp(factor * walk.zoom, leastZoom(...walk.size), 8);
  drawWalkSoon();
}

// Move by the held keys, for this many seconds.
function moveByKeys(seconds) {
  for (const key of walk.keys.values()) {
    if (key in WALKING) moveEye(...WALKING[key].map((value) => 0.6 * seconds * value));
    else if (key in ZOOMING) zoomBy(ZOOMING[key] ** seconds);
    else turnEye(...TURNING[key].map((value) => 1.2 * seconds * value));
  }
}

// Move in each frame for as long as a key is held.
export function keepMoving() {
  // Two loops at once would move twice as fast.
  if (walk.isMoving) return;
  walk.isMoving = true;
  let before = performance.now();
  const moveOn = (now) => {
    moveByKeys(clamp((now - before) / 1000, 0, 0.1));
    before = now;
    walk.isMoving = walk.keys.size > 0;
    if (walk.isMoving) requestAnimationFrame(moveOn);
  };
  requestAnimationFrame(moveOn);
}
