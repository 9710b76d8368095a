// Which views an eye is drawn from.

import { along, clamp, dot, minus } from "../page/vectors.js";
import { WALK, walk } from "./state.js";

// Whether a source sees in a direction of its own axes.
function isSeen([x, y, z]) {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let [u, v] = [x / sum, y / sum];
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u >= 0 ? 1 : -1), (1 - Math.abs(u)) * (v >= 0 ? 1 : -1)];
  const [column, line] = [u, v].map((value) => clamp(Math.floor(((value + 1) / 2) * WALK.side), 0, WALK.side - 1));
  return walk.sight[line * WALK.side + column] === 1;
}

// Unit directions all over what the eye sees, in the world.
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

// How well a view sees the point that is so far from the eye in a direction: 0 where it does not.
function quality(view, at, direction, distance) {
  const way = minus(along(at, direction, distance), view.at);
  const local = [dot(way, view.right), dot(way, view.up), -dot(way, view.ahead)];
  if (!isSeen(local)) return 0;
  const length = Math.hypot(...way);
  const angle = Math.hypot(...minus(direction, way.map((value) => value / length)));
  return 1 / (angle + WALK.distance * Math.max(length / distance - 1, 0) + WALK.sharp);
}

// The views that together see best what the eye looks at: one after the other, that which adds most.
export function bestViews(sources, count, at, eyeAxes, spread) {
  const directions = directionsOfEye(eyeAxes, spread);
  const qualities = sources.map(({ view }) => WALK.distances.flatMap((distance) =>
    directions.map((direction) => quality(view, at, direction, distance))));
  const chosen = [];
  let sums = qualities[0].map(() => 0);
  while (chosen.length < Math.min(count, sources.length)) {
    let best = { gain: -1, number: 0 };
    qualities.forEach((values, number) => {
      if (chosen.includes(number)) return;
      const gain = values.reduce((total, value, place) => total + Math.log1p(sums[place] + value), 0);
      if (gain > best.gain) best = { gain, number };
    });
    chosen.push(best.number);
    sums = sums.map((value, place) => value + qualities[best.number][place]);
  }
  return chosen.map((number) => sources[number]);
}

// The first view that is wanted and not on the graphics card yet.
export const missing = () => walk.wanted.find((source) => !source.isThere);

// Choose what an eye wants to be drawn of, and what it is drawn of while some of that is missing.
export function choose(count, ...eye) {
  walk.wanted = bestViews(walk.order, walk.sources, walk.at, ...eye);
  const there = walk.order.filter((source) => source.isThere);
  // They were taken one after the other: the first are the best of fewer, too.
  walk.chosen = missing() ? bestViews(there, count, walk.at, ...eye) : walk.wanted.slice(0, count);
}
