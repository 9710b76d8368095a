// The eye of the walk: its axes, its field of view, and the volume that it stays in.

import { along, clamp, dot } from "../page/vectors.js";
import { WALK, walk } from "./state.js";

// The nearest that the eye sees, in metres.
export const NEAR = 0.01;
// The field of view across the picture's longer side: between these, as wide as a pixel of a source needs it to be
// shown at most so many pixels wide.
const [NARROWEST, WIDEST] = [(80 * Math.PI) / 180, (120 * Math.PI) / 180];
const LARGEST_PIXEL = 3;
export const STEEPEST_PITCH = 1.5;

function ahead() {
  const level = Math.cos(walk.pitch);
  return [-Math.sin(walk.yaw) * level, Math.cos(walk.yaw) * level, Math.sin(walk.pitch)];
}

// The eye's axes in the world: right, up and back.
export function axes() {
  const back = ahead().map((value) => -value);
  const right = [Math.cos(walk.yaw), Math.sin(walk.yaw), 0];
  const up = [-back[2] * right[1], back[2] * right[0], back[0] * right[1] - back[1] * right[0]];
  return [right, up, back];
}

export function fieldOfView(width, height) {
  const wide = 2 * Math.atan((Math.max(width, height) / 2) * (WALK.pixel / LARGEST_PIXEL));
  return clamp(wide, NARROWEST, WIDEST);
}

// What a tangent is multiplied by across and up, to be 1 at the picture's edges.
export function scales(width, height) {
  const scale = walk.zoom / Math.tan(fieldOfView(width, height) / 2);
  return width >= height ? [scale, (scale * width) / height] : [(scale * height) / width, scale];
}

// How far it is from a place to the edge of the volume, in metres; negative beyond.
export const metresToEdge = (at) => Math.min(...WALK.planes.map(([x, y, z, c]) => -(dot([x, y, z], at) + c)));

// The place itself or, where it is beyond the volume, one at its edge.
export function insideVolume(at) {
  let place = at;
  // Twice: one plane's mend can lead beyond another.
  for (const [x, y, z, c] of [...WALK.planes, ...WALK.planes]) {
    const beyond = dot([x, y, z], place) + c;
    if (beyond > 0) place = along(place, [x, y, z], -beyond);
  }
  return place;
}
