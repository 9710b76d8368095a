// The epipolar-plane image, drawn, with the track of the point under the pointer.

import { DATA } from "./data.js";
import { fitted, onceAFrame } from "./document.js";
import { codeDeveloper } from "./look.js";
import { depthCode, depthOf, paint } from "./packing.js";
import { lines, viewer } from "./state.js";

export function epipolarPixel(x, y) {
  const [count, columns] = DATA.row.shape;
  return (lines.tilt * count + y) * columns + x;
}

export const angleAt = (x) => (2 * (x + 0.5 + DATA.row.first)) / DATA.row.columns - 1;
const columnAt = (angle) => ((angle + 1) / 2) * DATA.row.columns - DATA.row.first;

// Return the column in which each camera of the row sees the point at (x, y), by its depth.
function trace(x, y) {
  const depth = depthOf(depthCode(lines.pixels[1], 4 * epipolarPixel(x, y)), DATA.row.range);
  if (!Number.isFinite(depth)) return null;
  const { kind, places, centers, widest } = DATA.row;
  if (kind === "line") {
    const tangent = angleAt(x) * widest;
    return places.map((place) => columnAt((tangent + (places[y] - place) / depth) / widest));
  }
  const azimuth = angleAt(x) * Math.PI;
  const level = depth * Math.cos((DATA.row.tilts[lines.tilt] * Math.PI) / 180);
  const point = [centers[y][0] + level * Math.sin(azimuth), centers[y][1] + level * Math.cos(azimuth)];
  return centers.map((center) => columnAt(Math.atan2(point[0] - center[0], point[1] - center[1]) / Math.PI));
}

// Add a track to the path. The line breaks where no camera sees it, and where it wraps around a ring.
function trackPath(context, track, width, height) {
  const [count, columns] = DATA.row.shape;
  context.beginPath();
  let before = null;
  track.forEach((column, place) => {
    const [x, y] = [(column / columns) * width, ((place + 0.5) / count) * height];
    const pixel = Math.floor(column);
    const isInside = pixel >= 0 && pixel < columns;
    if (!isInside || depthCode(lines.pixels[1], 4 * epipolarPixel(pixel, place)) === 0) {
      before = null;
      return;
    }
    if (before === null || Math.abs(column - before) > DATA.row.columns / 2) context.moveTo(x, y);
    else context.lineTo(x, y);
    before = column;
  });
}

function linesPicture() {
  const [count, columns] = DATA.row.shape;
  const picture = new OffscreenCanvas(columns, count);
  const image = new ImageData(columns, count);
  const colours = lines.depth ? lines.colours : null;
  paint(image.data, lines.pixels[0], lines.pixels[1], epipolarPixel(0, 0), codeDeveloper(viewer.look, viewer.exposure), colours);
  picture.getContext("2d").putImageData(image, 0, 0);
  return picture;
}

export const drawLines = onceAFrame(() => {
  if (!lines.pixels) return;
  const context = fitted(lines.canvas);
  const [width, height] = [lines.canvas.clientWidth, lines.canvas.clientHeight];
  context.imageSmoothingEnabled = false;
  context.drawImage(linesPicture(), 0, 0, width, height);
  const track = lines.pointed && DATA.depth ? trace(...lines.pointed) : null;
  if (!track) return;
  trackPath(context, track, width, height);
  for (const [colour, thickness] of [["#000000", 4], ["#ffffff", 1.5]]) {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.stroke();
  }
});
