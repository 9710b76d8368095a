// Schedules the drawing of the walk, chooses its quality, and draws the overlay.

import { DATA } from "../page/data.js";
import { element, fitted, onceAFrame, polyline } from "../page/document.js";
import { dot, minus } from "../page/vectors.js";
import { IN_MOTION, choose, missing } from "./choice.js";
import { NEAR, axes, metresToEdge, scales } from "./eye.js";
import { drawEye } from "./layers.js";
import { MOST_SOURCES, walk } from "./state.js";

// If a full picture takes more milliseconds than this, a picture in motion uses few sources.
const SLOW = 100;
const FEW = Math.min(2, MOST_SOURCES);
// A still picture has this many samples across and down a pixel.
const FINE = 2;
// A picture in motion has this part of the pixels across and down. The browser enlarges it.
const COARSE = 0.33;
// The picture counts as still this many milliseconds after the last motion.
export const REST = 200;

// Resize the canvas to a part of its pixels across and down. Return its new width and height.
function sizeCanvas(part) {
  const { canvas } = walk;
  const [width, height] = walk.size.map((side) => Math.max(2, Math.round(part * side)));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  return [width, height];
}

// Draw one picture from the eye's place. In motion, draw it quickly, else as well as possible.
function drawWalk(isInMotion = false) {
  const eyeAxes = axes();
  const spread = scales(...walk.size);
  const size = sizeCanvas(isInMotion ? COARSE : 1);
  choose(isInMotion ? FEW : walk.sources, eyeAxes, spread, isInMotion ? IN_MOTION : 0);
  const eye = { at: walk.at, axes: eyeAxes, lens: [...spread, 0, 0], sources: walk.chosen };
  drawEye(eye, null, [0, 0], size, isInMotion ? 1 : FINE, isInMotion);
  drawOverlay(eyeAxes, spread);
  walk.frames += 1;
}

// Return the function that projects a point of the world onto the overlay. It returns null behind the eye.
function overlayProjection([right, up, back], [spreadX, spreadY]) {
  const [width, height] = [walk.overlay.clientWidth, walk.overlay.clientHeight];
  return (point) => {
    const offset = minus(point, walk.at);
    const depth = -dot(offset, back);
    if (depth < NEAR) return null;
    const [x, y] = [(spreadX * dot(offset, right)) / depth, (spreadY * dot(offset, up)) / depth];
    return [(width / 2) * (1 + x), (height / 2) * (1 - y)];
  };
}

function drawVolume(context, project) {
  context.strokeStyle = "rgb(255 255 255 / 35%)";
  context.beginPath();
  for (const line of DATA.outline) {
    let before = null;
    for (const point of line.map(project)) {
      if (before && point) polyline(context, [before, point]);
      before = point;
    }
  }
  context.stroke();
}

function drawCameras(context, project) {
  for (const source of walk.order) {
    const point = project(source.view.at);
    if (!point) continue;
    const isUsed = walk.chosen.includes(source);
    const side = isUsed ? 6 : 4;
    context.fillStyle = isUsed ? "#e69f00" : "rgb(255 255 255 / 60%)";
    context.fillRect(point[0] - 2, point[1] - 2, side, side);
  }
}

// Draw the volume's edge and the cameras over the picture. Mark the cameras in use.
function drawOverlay(eyeAxes, spread) {
  const context = fitted(walk.overlay);
  if (walk.showsCameras) {
    const project = overlayProjection(eyeAxes, spread);
    drawVolume(context, project);
    drawCameras(context, project);
  }
  showReadout();
}

export function showReadout() {
  // Adding 0 turns −0 into 0.
  const place = walk.at.map((value) => (Math.round(100 * value) / 100 + 0).toFixed(2));
  const loaded = walk.order.filter((source) => source.isLoaded).length;
  const parts = [
    `at ${place.join(", ")} m`,
    `${metresToEdge(walk.at).toFixed(2)} m to the edge`,
    `made of ${walk.chosen.length} of ${walk.order.length} views`,
  ];
  if (loaded < walk.order.length) parts.push(`${loaded} loaded so far`);
  element("walk-readout").textContent = parts.join(" · ");
}

export const drawWalkSoon = onceAFrame(() => {
  if (!walk.ready) return;
  walk.drawnAt = performance.now();
  drawWalk(walk.slow);
  clearTimeout(walk.rest);
  if (walk.slow) walk.rest = setTimeout(drawAllSources, REST);
});

// Draw from all sources, and measure how long that takes. Reading a pixel waits until the drawing is done.
function drawAllSources() {
  if (!walk.ready || missing()) return;
  const { gl } = walk;
  const start = performance.now();
  drawWalk();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  walk.slow = performance.now() - start > SLOW;
}
