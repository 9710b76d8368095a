// Draws the rig in 3D: its cameras, its outline and the scene's points.

import { DATA, row, shown } from "./data.js";
import { element, fitted, onceAFrame, polyline, themed } from "./document.js";
import { bytesOf } from "./packing.js";
import { rig, viewer } from "./state.js";
import { along, clamp, dot, minus } from "./vectors.js";

// Focal length of the picture of the rig, in lengths of its shorter side.
const SPREAD = 1.75;
// More cameras than this are drawn as lines instead of frusta, to stay fluid.
const MOST_FRUSTA = 700;

export function measureRig() {
  const points = [...DATA.views.map((view) => view.at), ...DATA.outline.flat()];
  const low = [0, 1, 2].map((axis) => points.reduce((least, point) => Math.min(least, point[axis]), Infinity));
  const high = [0, 1, 2].map((axis) => points.reduce((most, point) => Math.max(most, point[axis]), -Infinity));
  rig.center = low.map((value, axis) => (value + high[axis]) / 2);
  rig.extent = Math.max(Math.hypot(...minus(high, low)) / 2, 0.05);
  rig.camera = Math.min(0.14, 1.1 / Math.sqrt(DATA.views.length)) * rig.extent;
}

function projection(width, height) {
  const [sine, cosine] = [Math.sin(rig.turn), Math.cos(rig.turn)];
  const [rise, level] = [Math.sin(rig.rise), Math.cos(rig.rise)];
  const right = [cosine, sine, 0];
  const ahead = [-sine * level, cosine * level, -rise];
  const up = [-sine * rise, cosine * rise, level];
  const distance = (4 * rig.extent) / rig.zoom;
  const scale = SPREAD * Math.min(width, height);
  return (point) => {
    const way = minus(point, rig.center);
    const depth = dot(way, ahead) + distance;
    const size = scale / Math.max(depth, 1e-3 * distance);
    return [width / 2 + dot(way, right) * size, height / 2 - dot(way, up) * size, depth];
  };
}

// Return the points that the views' depth gives: a list of places and colours.
export function scenePoints() {
  if (!DATA.points) return [];
  const { low, side } = DATA.points;
  const steps = new Uint16Array(bytesOf(DATA.points.places).buffer);
  const colours = bytesOf(DATA.points.colours);
  return Array.from({ length: steps.length / 3 }, (_, number) => {
    const at = low.map((value, axis) => value + (steps[3 * number + axis] / 65535) * side);
    const colour = `rgb(${colours.subarray(3 * number, 3 * number + 3).join(" ")})`;
    return { at, colour, size: 0.012 * (rig.extent + Math.hypot(...minus(at, rig.center))) };
  });
}

// Draw the points from far to near. A square grows with its distance from the rig, as the spacing does.
function drawPoints(context, project, scale) {
  const nearest = (0.5 * 4 * rig.extent) / rig.zoom;
  const drawn = rig.points.map((point) => [...project(point.at), point]);
  drawn.sort((a, b) => b[2] - a[2]);
  for (const [x, y, depth, { colour, size }] of drawn) {
    if (depth < nearest) continue;
    const side = clamp((size * scale) / depth, 1, 3.5);
    context.fillStyle = colour;
    context.fillRect(x - side / 2, y - side / 2, side, side);
  }
}

function drawGround(context, project) {
  const [x, y, z] = rig.center;
  if (z < 0 || z > 3 * rig.extent) return;
  const reach = clamp(Math.ceil(1.5 * rig.extent), 1, 20);
  const middle = [Math.round(x), Math.round(y)];
  context.strokeStyle = themed("--line");
  context.beginPath();
  for (let offset = -reach; offset <= reach; offset++) {
    polyline(context, [-reach, reach].map((end) => project([middle[0] + offset, middle[1] + end, 0])));
    polyline(context, [-reach, reach].map((end) => project([middle[0] + end, middle[1] + offset, 0])));
  }
  context.stroke();
}

function drawAxes(context, project, height) {
  const origin = project(rig.center);
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  ["X", "Y", "Z"].forEach((name, axis) => {
    const unit = [0, 0, 0];
    unit[axis] = 0.01 * rig.extent;
    const tip = project(along(rig.center, unit, 1));
    const length = 28 / ((0.01 * SPREAD * Math.min(rig.canvas.clientWidth, height)) / (4 / rig.zoom));
    const [x, y] = [(tip[0] - origin[0]) * length, (tip[1] - origin[1]) * length];
    context.strokeStyle = context.fillStyle = themed("--soft");
    context.beginPath();
    polyline(context, [[44, height - 44], [44 + x, height - 44 + y]]);
    context.stroke();
    context.fillText(name, 44 + 1.35 * x, height - 44 + 1.35 * y);
  });
}

// A view's part of the split matters more than whether it is in the page or in the row.
function colourOf(number) {
  const { part } = DATA.views[number];
  if (part === "test" || part === "validation") return `--${part}`;
  if (row.has(number)) return "--row";
  return shown.has(number) ? "--shown" : "--faint";
}

function addCamera(context, view, project, isSimple) {
  const apex = project(view.at);
  if (isSimple) {
    polyline(context, [apex, project(along(view.at, view.ahead, 1.4 * rig.camera))]);
    return;
  }
  const middle = along(view.at, view.ahead, rig.camera);
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
    project(along(along(middle, view.right, 0.6 * x * rig.camera), view.up, 0.45 * y * rig.camera)));
  polyline(context, [...corners, corners[0]]);
  for (const corner of corners) polyline(context, [apex, corner]);
}

function showTip() {
  const tip = element("rig-name");
  tip.hidden = rig.hover === null;
  if (tip.hidden) return;
  const [x, y] = rig.screen[rig.hover];
  const { name, part } = DATA.views[rig.hover];
  tip.textContent = part ? `${name} (${part})` : name;
  const half = tip.offsetWidth / 2;
  tip.style.left = `${clamp(x, half, rig.canvas.clientWidth - half)}px`;
  tip.style.top = `${Math.max(y, 40)}px`;
}

function drawOutline(context, project) {
  context.strokeStyle = themed("--faint");
  context.beginPath();
  for (const line of DATA.outline) polyline(context, line.map(project));
  context.stroke();
}

// Draw the cameras of one colour in front of the rig's centre, or behind it. One path is fastest.
function drawCamerasOf(context, project, colour, isBehind) {
  const isSimple = DATA.views.length > MOST_FRUSTA;
  const centreDepth = (4 * rig.extent) / rig.zoom;
  const side = clamp(60 / Math.sqrt(DATA.views.length), 1.2, 3);
  const drawn = [...DATA.views.keys()].filter((number) =>
    rig.screen[number][2] > centreDepth === isBehind && colourOf(number) === colour);
  context.strokeStyle = context.fillStyle = themed(colour);
  context.lineWidth = 1;
  context.beginPath();
  for (const number of drawn) addCamera(context, DATA.views[number], project, isSimple);
  context.stroke();
  for (const number of drawn) {
    const [x, y] = rig.screen[number];
    context.fillRect(x - side / 2, y - side / 2, side, side);
  }
}

function markCamera(context, project, number, colour, thickness) {
  const isSimple = DATA.views.length > MOST_FRUSTA;
  const [x, y] = rig.screen[number];
  context.strokeStyle = context.fillStyle = themed(colour);
  context.lineWidth = thickness;
  context.beginPath();
  addCamera(context, DATA.views[number], project, isSimple);
  context.stroke();
  context.beginPath();
  context.arc(x, y, 4, 0, 2 * Math.PI);
  context.fill();
  context.lineWidth = 1;
}

export const drawRig = onceAFrame(() => {
  const context = fitted(rig.canvas);
  const [width, height] = [rig.canvas.clientWidth, rig.canvas.clientHeight];
  const project = projection(width, height);
  drawGround(context, project);
  if (rig.showsPoints) drawPoints(context, project, SPREAD * Math.min(width, height));
  drawOutline(context, project);
  rig.screen = DATA.views.map((view) => project(view.at));
  // Draw cameras behind the centre first and paler.
  for (const isBehind of [true, false]) {
    context.globalAlpha = isBehind ? 0.4 : 1;
    for (const colour of ["--faint", "--shown", "--row", "--validation", "--test"]) {
      drawCamerasOf(context, project, colour, isBehind);
    }
  }
  context.globalAlpha = 1;
  markCamera(context, project, DATA.embedded[viewer.current].view, "--current", 2.5);
  if (rig.hover !== null) markCamera(context, project, rig.hover, "--ink", 1.5);
  drawAxes(context, project, height);
  showTip();
});
