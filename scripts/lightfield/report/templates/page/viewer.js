// The viewer: one view, its exposure, its depth, and the way to its neighbours.

import { DATA } from "./data.js";
import { chooseDepth, element, onceAFrame } from "./document.js";
import { drawLines } from "./epipolar_drawing.js";
import { codeDeveloper, lookTable } from "./look.js";
import { LIGHT, bytesOf, decoded, depthCode, depthColours, depthOf, metres, paint } from "./packing.js";
import { drawRig } from "./rig_drawing.js";
import { rig, viewer } from "./state.js";
import { clamp, dot, minus } from "./vectors.js";

// A sensor's codes are shown as they are.
const asTheyAre = (codes, source, target, at) => target.set(codes.subarray(source, source + 3), at);

async function pixelsOf(number) {
  if (!viewer.cache.has(number)) {
    const entry = DATA.embedded[number];
    const pictures = [entry.light, entry.depth, entry.sensor];
    viewer.cache.set(number, Promise.all(pictures.map((picture) => (picture ? decoded(picture) : null))));
    // Keep 32 views, so that stepping back and forth is quick.
    if (viewer.cache.size > 32) viewer.cache.delete(viewer.cache.keys().next().value);
  }
  return viewer.cache.get(number);
}

async function open(number) {
  viewer.current = number;
  const view = DATA.views[DATA.embedded[number].view];
  element("view-slider").value = number;
  element("view-name").textContent = view.name;
  for (const button of document.querySelectorAll("[data-step]")) {
    button.disabled = neighbour(button.dataset.step) === null;
  }
  drawRig();
  const pixels = await pixelsOf(number);
  viewer.look = await lookTable;
  if (viewer.current !== number) return;
  viewer.pixels = pixels;
  drawView();
}

const drawView = onceAFrame(() => {
  if (!viewer.pixels) return;
  const [width, height] = DATA.size;
  const [light, depth, sensor] = viewer.pixels;
  const context = viewer.canvas.getContext("2d");
  const image = context.createImageData(width, height);
  if (viewer.sensor && !viewer.depth) {
    paint(image.data, sensor, depth, 0, asTheyAre, null);
  } else {
    const colours = viewer.depth ? viewer.colours : null;
    paint(image.data, light, depth, 0, codeDeveloper(viewer.look, viewer.exposure), colours);
  }
  context.putImageData(image, 0, 0);
  readOut();
});

function readOut() {
  if (!viewer.pointed || !viewer.pixels) return;
  const [width, height] = DATA.size;
  const [x, y] = viewer.pointed;
  const at = 4 * (y * width + x);
  const [light, depth, sensor] = viewer.pixels;
  const place = [
    Math.floor(((x + 0.5) * DATA.resolution[0]) / width),
    Math.floor(((y + 0.5) * DATA.resolution[1]) / height),
  ];
  const radiance = [0, 1, 2].map((channel) => LIGHT[light[at + channel]].toPrecision(2));
  const parts = [["pixel", place.join(", ")], ["radiance R G B", radiance.join("  ")]];
  if (viewer.sensor) {
    parts.push(["sensor R G B", [0, 1, 2].map((channel) => sensor[at + channel]).join("  ")]);
  }
  if (depth) {
    const value = depthOf(depthCode(depth, at), DATA.depth.range);
    const name = DATA.depth.meaning === "z" ? "Z-depth" : "distance";
    parts.push([name, Number.isNaN(value) ? "outside the lens" : metres(value)]);
  }
  const line = element("readout");
  line.replaceChildren();
  for (const [title, value] of parts) {
    const number = document.createElement("b");
    number.textContent = value;
    line.append(`${title} `, number, "   ");
  }
}

// Return the nearest camera in a direction of the open view's axes. If there is none, return the
// nearest camera that looks in that direction.
function neighbour(direction) {
  const from = DATA.views[DATA.embedded[viewer.current].view];
  const sign = direction === "left" || direction === "down" ? -1 : 1;
  const axis = direction === "left" || direction === "right" ? from.right : from.up;
  const way = axis.map((value) => sign * value);
  let best = null;
  let turned = null;
  DATA.embedded.forEach((entry, number) => {
    if (number === viewer.current) return;
    const other = DATA.views[entry.view];
    const offset = minus(other.at, from.at);
    const length = Math.hypot(...offset);
    const towards = length > 1e-6 ? dot(offset, way) / length : 0;
    // Within 60 degrees. A small angle counts for more than a small distance.
    if (towards > 0.5 && dot(other.ahead, from.ahead) > -0.2) {
      const cost = length / towards ** 2;
      if (!best || cost < best.cost) best = { cost, number };
    }
    if (dot(other.ahead, way) > 0.5 && (!turned || length < turned.length)) turned = { length, number };
  });
  const nearest = best || turned;
  return nearest ? nearest.number : null;
}

function step(direction) {
  const next = neighbour(direction);
  if (next !== null) open(next);
}

// Open a camera's view. If it is not in the page, open the most similar one.
export function openView(view) {
  const target = DATA.views[view];
  let best = { cost: Infinity, number: 0 };
  DATA.embedded.forEach((entry, number) => {
    const other = DATA.views[entry.view];
    const cost = Math.hypot(...minus(other.at, target.at)) + rig.extent * (1 - dot(other.ahead, target.ahead));
    if (entry.view === view || cost < best.cost) best = { cost: entry.view === view ? -1 : cost, number };
  });
  open(best.number);
}

function pointAtView(event) {
  const frame = viewer.canvas.getBoundingClientRect();
  const [width, height] = DATA.size;
  viewer.pointed = [
    clamp(Math.floor(((event.clientX - frame.left) / frame.width) * width), 0, width - 1),
    clamp(Math.floor(((event.clientY - frame.top) / frame.height) * height), 0, height - 1),
  ];
  readOut();
}

function showExposure() {
  const stops = viewer.exposure - DATA.exposure;
  element("exposure-value").textContent = `${stops < 0 ? "−" : "+"}${Math.abs(stops).toFixed(1)} stops`;
}

function startExposure() {
  const slider = element("exposure");
  slider.addEventListener("input", () => {
    viewer.exposure = DATA.exposure + Number(slider.value);
    showExposure();
    drawView();
    drawLines();
  });
  showExposure();
}

function startDepthButton() {
  const [light, depth] = [element("show-light"), element("show-depth")];
  if (!DATA.depth) {
    depth.disabled = true;
    depth.title = "These views have no depth";
    return;
  }
  viewer.colours = depthColours(DATA.depth.range);
  startDepthScale();
  chooseDepth(light, depth, (isDepth) => {
    viewer.depth = isDepth;
    element("depth-scale").hidden = !isDepth;
    drawView();
  });
}

function startSensorButton() {
  const button = element("show-sensor");
  if (!button) return;
  button.addEventListener("click", () => {
    viewer.sensor = !viewer.sensor;
    button.setAttribute("aria-pressed", String(viewer.sensor));
    drawView();
  });
}

function startSteps() {
  for (const button of document.querySelectorAll("[data-step]")) {
    button.addEventListener("click", () => step(button.dataset.step));
  }
  const keys = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down" };
  for (const canvas of [viewer.canvas, element("rig")]) {
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in keys)) return;
      event.preventDefault();
      step(keys[event.key]);
    });
  }
}

function startDepthScale() {
  const [near, far] = DATA.depth.shown;
  const context = element("depth-bar").getContext("2d");
  const image = context.createImageData(256, 1);
  const bytes = bytesOf(DATA.depth.colours);
  for (let place = 0; place < 256; place++) {
    for (let channel = 0; channel < 3; channel++) {
      image.data[4 * place + channel] = bytes[3 * place + channel];
    }
    image.data[4 * place + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  for (let tick = 0; tick < 5; tick++) {
    const label = document.createElement("span");
    label.textContent = metres(2 ** (near + (tick / 4) * (far - near)));
    element("depth-ticks").append(label);
  }
}

export function startViewer() {
  const [width, height] = DATA.size;
  viewer.canvas.width = width;
  viewer.canvas.height = height;
  viewer.canvas.style.aspectRatio = `${width} / ${height}`;
  viewer.canvas.addEventListener("pointermove", pointAtView);
  viewer.canvas.addEventListener("pointerdown", pointAtView);
  const slider = element("view-slider");
  slider.max = DATA.embedded.length - 1;
  slider.addEventListener("input", () => open(Number(slider.value)));
  startExposure();
  startDepthButton();
  startSensorButton();
  startSteps();
  open(DATA.first);
}
