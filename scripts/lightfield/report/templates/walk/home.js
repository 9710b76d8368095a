// Places the eye: at the start of the walk, and after a change to another frame of a sequence.

import { element } from "../page/document.js";
import { clamp } from "../page/vectors.js";
import { drawWalkSoon } from "./drawing.js";
import { STEEPEST_PITCH, insideVolume, metresToEdge } from "./eye.js";
import { MODES, WALK, walk } from "./state.js";

export function showMode(mode) {
  walk.mode = mode;
  MODES.forEach((name, number) => element(`walk-${name}`).setAttribute("aria-pressed", number === mode));
  drawWalkSoon();
}

// Another frame of a sequence is another page. The address carries the eye's place to it.
const PLACE = "#walk=";
export const placeHash = () => PLACE + [...walk.at, walk.yaw, walk.pitch, walk.mode].join(",");

export function restorePlace() {
  if (!location.hash.startsWith(PLACE)) return;
  const [x, y, z, yaw, pitch, mode] = location.hash.slice(PLACE.length).split(",").map(Number);
  if (![x, y, z, yaw, pitch].every(Number.isFinite) || !(mode in MODES)) return;
  Object.assign(walk, { at: insideVolume([x, y, z]), yaw, pitch });
  showMode(mode);
  element("walk-section").scrollIntoView();
}

// Put the eye where the views see most: report/walk_start.py chooses this.
export function goHome() {
  const { at, yaw, pitch } = WALK.start;
  walk.at = insideVolume(at);
  walk.yaw = yaw;
  walk.pitch = clamp(pitch, -STEEPEST_PITCH, STEEPEST_PITCH);
  walk.zoom = 1;
  walk.fadeFrom = Math.min(walk.extent / 4, metresToEdge(walk.at));
  drawWalkSoon();
}
