// Where the walk begins, and where it goes on in another frame of a sequence.

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

// Another frame of a sequence is another page, which goes on from where the eye was.
const PLACE = "#walk=";
export const placeHash = () => PLACE + [...walk.at, walk.yaw, walk.pitch, walk.mode].join(",");

export function goWhereItWas() {
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

// Whether the cameras look at what is amid them.
function doLookInwards(views, centre) {
  const cosines = views.map((view) => {
    const way = minus(centre, view.at);
    return dot(view.ahead, way) / (Math.hypot(...way) || 1);
  });
  return cosines.reduce((sum, cosine) => sum + cosine, 0) > views.length / 2;
}

// The walk begins where the cameras see something: amid them, unless they look inwards. Amid those
// is what they look at, so it begins before one of them, and looks as that does.
export function goHome() {
  const views = walk.order.map(({ view }) => view);
  const centre = meanVector(views.map((view) => view.at));
  const first = DATA.views[DATA.embedded[DATA.first].view];
  const [x, y, z] = first.ahead;
  const lookInwards = doLookInwards(views, centre);
  const lookAlike = Math.hypot(...meanVector(views.map((view) => view.ahead))) > 0.5;
  // Away from the edge, but not into what is seen.
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
