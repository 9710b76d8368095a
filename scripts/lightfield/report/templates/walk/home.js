// Places the eye: at the start of the walk, and after a change to another frame of a sequence.

import { DATA } from "../page/data.js";
import { element } from "../page/document.js";
import { along, clamp, dot, minus } from "../page/vectors.js";
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

function meanVector(vectors) {
  return [0, 1, 2].map((axis) => vectors.reduce((sum, vector) => sum + vector[axis], 0) / vectors.length);
}

// Return whether the cameras look at something in their middle.
function camerasLookInwards(views, centre) {
  const cosines = views.map((view) => {
    const offset = minus(centre, view.at);
    return dot(view.ahead, offset) / (Math.hypot(...offset) || 1);
  });
  return cosines.reduce((sum, cosine) => sum + cosine, 0) > views.length / 2;
}

// Put the eye in the middle of the cameras. If they look inwards, what they look at is there. Then put the eye in front
// of the first camera, with the camera's direction.
export function goHome() {
  const views = walk.order.map(({ view }) => view);
  const centre = meanVector(views.map((view) => view.at));
  const first = DATA.views[DATA.embedded[DATA.first].view];
  const [x, y, z] = first.ahead;
  const lookInwards = camerasLookInwards(views, centre);
  const lookAlike = Math.hypot(...meanVector(views.map((view) => view.ahead))) > 0.5;
  // Move away from the volume's edge, but not into the nearest surface.
  const step = Math.min(walk.extent, WALK.nearest) / 4;
  walk.at = insideVolume(lookInwards ? along(first.at, first.ahead, step) : centre);
  const isSteep = Math.hypot(x, y) <= 0.1;
  walk.yaw = isSteep ? 0 : Math.atan2(-x, y);
  const pitch = lookInwards || lookAlike ? Math.asin(clamp(z, -1, 1)) : 0;
  walk.pitch = clamp(pitch, -STEEPEST_PITCH, STEEPEST_PITCH);
  walk.zoom = 1;
  walk.fadeFrom = Math.min(walk.extent / 4, metresToEdge(walk.at));
  drawWalkSoon();
}
