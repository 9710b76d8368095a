// Chooses the views from which an eye's picture is drawn.

import { clamp, minus } from "../page/vectors.js";
import { WALK, walk } from "./state.js";

// In motion, views are chosen again only if the eye has moved by more than this part of the rig's extent, or turned by
// more than this many radians.
export const IN_MOTION = 0.03;
// A few views of a picture in motion leave half as many directions unseen as with 1.
const COVERING = 1000;

// Return whether a source sees in a direction, given in its own axes.
function isSeen(x, y, z) {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let [u, v] = [x / sum, y / sum];
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u >= 0 ? 1 : -1), (1 - Math.abs(u)) * (v >= 0 ? 1 : -1)];
  const column = clamp(Math.floor(((u + 1) / 2) * WALK.side), 0, WALK.side - 1);
  const line = clamp(Math.floor(((v + 1) / 2) * WALK.side), 0, WALK.side - 1);
  return walk.sight[line * WALK.side + column] === 1;
}

// Return unit directions in the world that cover the eye's picture evenly.
function directionsOfEye([right, up, back], [spreadX, spreadY]) {
  const count = WALK.directions;
  const directions = [];
  for (let line = 0; line < count; line++) {
    for (let column = 0; column < count; column++) {
      const x = (((column + 0.5) / count - 0.5) * 2) / spreadX;
      const y = ((0.5 - (line + 0.5) / count) * 2) / spreadY;
      const ray = [0, 1, 2].map((axis) => x * right[axis] + y * up[axis] - back[axis]);
      const length = Math.hypot(...ray);
      directions.push(ray.map((value) => value / length));
    }
  }
  return directions;
}

// Return how well a view sees the point at a distance from the eye in a direction. 0 if it does not see it.
function quality({ at, right, up, ahead }, eye, direction, distance) {
  const x = eye[0] + distance * direction[0] - at[0];
  const y = eye[1] + distance * direction[1] - at[1];
  const z = eye[2] + distance * direction[2] - at[2];
  const along = ([a, b, c]) => a * x + b * y + c * z;
  if (!isSeen(along(right), along(up), -along(ahead))) return 0;
  const length = Math.sqrt(x * x + y * y + z * z);
  const [dx, dy, dz] = [direction[0] - x / length, direction[1] - y / length, direction[2] - z / length];
  const angle = Math.sqrt(dx * dx + dy * dy + dz * dz);
  return 1 / (angle + WALK.distance * Math.max(length / distance - 1, 0) + WALK.sharp);
}

function qualities(view, at, directions) {
  const values = new Float64Array(WALK.distances.length * directions.length);
  WALK.distances.forEach((distance, part) => directions.forEach((direction, place) => {
    values[part * directions.length + place] = quality(view, at, direction, distance);
  }));
  return values;
}

// Return the sum over all directions of the logarithm of the worth of this view and the views taken so far.
function gainOf(values, sums, covering) {
  let gain = 0;
  for (let place = 0; place < sums.length; place++) gain += Math.log1p(covering * (sums[place] + values[place]));
  return gain;
}

// Return the views that together best see what the eye looks at. Repeatedly takes the view that adds most. The larger
// `covering` is, the more it counts to see a direction at all.
export function bestViews(sources, count, at, eyeAxes, spread, covering = 1) {
  const directions = directionsOfEye(eyeAxes, spread);
  const valued = sources.map((source) => ({ source, values: qualities(source.view, at, directions) }));
  const sums = new Float64Array(WALK.distances.length * directions.length);
  const chosen = [];
  while (chosen.length < Math.min(count, sources.length)) {
    const rest = valued.filter(({ source }) => !chosen.includes(source));
    const gains = rest.map(({ values }) => gainOf(values, sums, covering));
    const best = rest[gains.indexOf(Math.max(...gains))];
    chosen.push(best.source);
    best.values.forEach((value, place) => {
      sums[place] += value;
    });
  }
  return chosen;
}

// Return the first wanted view that is not on the graphics card yet.
export const missing = () => walk.wanted.find((source) => !source.isLoaded);

// Return whether the last choice still fits: no source was loaded since, and the eye has hardly moved.
function stillFits(last, now, slack) {
  if (!last || last.loaded.length !== now.loaded.length || last.count !== now.count) return false;
  const change = (before, after) => Math.hypot(...minus(before, after));
  return change(last.at, now.at) <= slack * walk.extent &&
    now.axes.every((axis, number) => change(last.axes[number], axis) <= slack) &&
    now.spread.every((value, number) => value === last.spread[number]);
}

// Choose the views that an eye wants. While some of these are missing, choose others to draw. An eye that has moved by
// at most `slack` keeps the last choice.
export function choose(count, eyeAxes, spread, slack) {
  const loaded = walk.order.filter((source) => source.isLoaded);
  const now = { at: walk.at, axes: eyeAxes, spread, loaded, count };
  if (stillFits(walk.lastChoice, now, slack)) return;
  walk.lastChoice = now;
  walk.choices += 1;
  walk.wanted = bestViews(walk.order, walk.sources, walk.at, eyeAxes, spread);
  if (missing()) walk.chosen = bestViews(loaded, count, walk.at, eyeAxes, spread);
  else if (count >= walk.wanted.length) walk.chosen = walk.wanted;
  else walk.chosen = bestViews(walk.wanted, count, walk.at, eyeAxes, spread, COVERING);
}
