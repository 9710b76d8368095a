// Lets the user point at the epipolar-plane image, and tilt its plane.

import { DATA } from "./data.js";
import { chooseDepth, element } from "./document.js";
import { angleAt, drawLines, epipolarPixel } from "./epipolar_drawing.js";
import { decoded, depthCode, depthColours, depthOf, metres } from "./packing.js";
import { drawRig } from "./rig_drawing.js";
import { lines, rig } from "./state.js";
import { clamp } from "./vectors.js";
import { openView } from "./viewer.js";

function pointAtLines(event) {
  if (!lines.pixels) return;
  const [count, columns] = DATA.row.shape;
  const frame = lines.canvas.getBoundingClientRect();
  const x = clamp(Math.floor(((event.clientX - frame.left) / frame.width) * columns), 0, columns - 1);
  const y = clamp(Math.floor(((event.clientY - frame.top) / frame.height) * count), 0, count - 1);
  lines.pointed = [x, y];
  rig.hover = DATA.row.rows[y];
  const line = DATA.row.kind === "line";
  const degrees = line ? (Math.atan(angleAt(x) * DATA.row.widest) * 180) / Math.PI : angleAt(x) * 180;
  const parts = [DATA.views[DATA.row.rows[y]].name, `${line ? "angle" : "azimuth"} ${degrees.toFixed(1)}°`];
  if (DATA.depth) {
    const depth = depthOf(depthCode(lines.pixels[1], 4 * epipolarPixel(x, y)), DATA.row.range);
    const name = line ? "perpendicular distance" : "distance";
    parts.push(Number.isNaN(depth) ? "not seen" : `${name} ${metres(depth)}`);
  }
  element("epi-readout").textContent = parts.join("   ");
  drawLines();
  drawRig();
}

function startTilt() {
  const { tilts } = DATA.row;
  const slider = element("epi-tilt");
  const show = () => {
    element("epi-tilt-value").textContent = `${tilts[lines.tilt]}°`.replace("-", "−");
  };
  lines.tilt = tilts.indexOf(0);
  slider.max = tilts.length - 1;
  slider.value = lines.tilt;
  show();
  slider.addEventListener("input", () => {
    lines.tilt = Number(slider.value);
    show();
    drawLines();
  });
}

function startLinesDepthButton() {
  lines.colours = depthColours(DATA.row.range);
  chooseDepth(element("epi-light"), element("epi-depth"), (isDepth) => {
    lines.depth = isDepth;
    drawLines();
  });
}

function leaveLines() {
  lines.pointed = null;
  rig.hover = null;
  drawLines();
  drawRig();
}

export async function startLines() {
  if (!DATA.row) return;
  startTilt();
  if (DATA.depth) startLinesDepthButton();
  lines.canvas.addEventListener("pointermove", pointAtLines);
  lines.canvas.addEventListener("pointerdown", (event) => {
    pointAtLines(event);
    if (lines.pointed) openView(DATA.row.rows[lines.pointed[1]]);
  });
  lines.canvas.addEventListener("pointerleave", leaveLines);
  new ResizeObserver(drawLines).observe(lines.canvas);
  lines.pixels = await Promise.all([decoded(DATA.row.light), decoded(DATA.row.depth)]);
  drawLines();
}
