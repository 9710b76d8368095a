// Computes the eye's axes and field of view, and keeps it inside the volume.

import { along, clamp, dot } from "../page/vectors.js";
import { WALK, walk } from "./state.js";

// The eye sees nothing nearer than this, in metres.
export const NEAR = 0.01;
// The limits of the widest field of view across the picture's longer side. Between these, it is so wide that a source's
// pixel shows at most LARGEST_PIXEL pixels wide.
const [NARROWEST, WIDEST] = [(80 * Math.PI) / 180, (120 * Math.PI) / 180];
const LARGEST_PIXEL = 3;
export const STEEPEST_PITCH = 1.5;

function ahead() {
  const level = Math.cos(walk.pitch);
  return [-Math.sin(walk.yaw) * level, Math.cos(walk.yaw) * level, Math.sin(walk.pitch)];
}

// Return the eye's axes in the world: right, up and back.
export function axes() {
  const back = ahead().map((value) => -value);
  const right = [Math.cos(walk.yaw), Math.sin(walk.yaw), 0];
  const up = [-back[2] * right[1], back[2] * right[0], back[0] * right[1] - back[1] * right[0]];
  return [right, up, back];
}

function widestFieldOfView(width, height) {
  const wide = 2 * Math.atan((Math.max(width, height) / 2) * (WALK.pixel / LARGEST_PIXEL));
  return clamp(wide, NARROWEST, WIDEST);
}

// Return the field of view of the zoom 1: the lens's own, but not the widest. Beyond it, a picture would mostly be filled.
export function fieldOfView(width, height) {
  const [across, down] = WALK.fieldOfView;
  return Math.min(width >= height ? across : down, widestFieldOfView(width, height));
}

// Return the zoom with the widest field of view, at most 1.
export function leastZoom(width, height) {
  return Math.tan(fieldOfView(width, height) / 2) / Math.tan(widestFieldOfView(width, height) / 2);
}

// Return the factors across and up by which a tangent becomes 1 at the picture's edges.
export function scales(width, height) {
  const scale = walk.zoom / Math.tan(fieldOfView(width, height) / 2);
  return width >= height ? [scale, (scale * width) / height] : [(scale * height) / width, scale];
}

// Return the distance from a place to the volume's edge in metres. It is negative outside.
export const metresToEdge = (at) => Math.min(...WALK.planes.map(([x, y, z, c]) => -(dot([x, y, z], at) + c)));

// Return the place itself if it is inside the volume, else a place at its edge.
export function insideVolume(at) {
  let place = at;
  // Check all planes twice: a move onto one plane can lead beyond another.
  for (const [x, y, z, c] of [...WALK.planes, ...WALK.planes]) {
    const beyond = dot([x, y, z], place) + c;
    if (beyond > 0) place = along(place, [x, y, z], -beyond);
  }
  return place;
}
