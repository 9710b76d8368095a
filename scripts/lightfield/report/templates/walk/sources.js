// A source view on the graphics card: its colours, its inverse distances, and the triangles that hold.

import { DATA } from "../page/data.js";
import { depthCode } from "../page/packing.js";
import { WALK, walk } from "./state.js";
import { texture, triangles } from "./webgl.js";

// Between the last vertex of a row and the first of the next so many numbers are left out: what draws
// without a graphics card keeps a vertex by its number modulo 64, where the one below would drop it.
export const APART = 32;

// Of the unit square's point, the unit vector (Cigolle et al. 2014).
export function unfolded(u, v) {
  let [x, y] = [2 * u - 1, 2 * v - 1];
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x >= 0 ? 1 : -1), (1 - Math.abs(x)) * (y >= 0 ? 1 : -1)];
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

// Whether two neighbours a and b in a row of inverse distances are of one surface.
function isOneSurface(before, a, b, after) {
  const step = b - a;
  if (Number.isNaN(step)) return false;
  if (Math.abs(step) <= Math.max(WALK.steepest * Math.max(a, b), WALK.far)) return true;
  if (Math.min(a, b) === 0) return false;
  const even = WALK.even * Math.abs(step);
  return Math.abs(a - before - step) < even && Math.abs(after - b - step) < even;
}

// The inverse distance from the camera of each pixel, NaN outside the lens.
function inverseDistances(depth) {
  const [width, height] = DATA.size;
  const inverses = new Float32Array(width * height);
  for (let pixel = 0; pixel < inverses.length; pixel++) {
    const cosine = DATA.depth.meaning === "z" ? -walk.rays[4 * pixel + 2] : 1;
    inverses[pixel] = cosine * walk.inverses[depthCode(depth, 4 * pixel)];
  }
  return inverses;
}

// For each pixel, whether it is of one surface with the pixel on its right, and with that below it.
function joins(inverses) {
  const [width, height] = DATA.size;
  const at = (i, j) => (i < 0 || j < 0 || i >= height || j >= width ? NaN : inverses[i * width + j]);
  const right = new Uint8Array(width * height);
  const down = new Uint8Array(width * height);
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const pixel = i * width + j;
      right[pixel] = isOneSurface(at(i, j - 1), at(i, j), at(i, j + 1), at(i, j + 2));
      down[pixel] = isOneSurface(at(i - 1, j), at(i, j), at(i + 1, j), at(i + 2, j));
    }
  }
  return { right, down };
}

// The number of a pixel's vertex.
const vertexOf = (i, j) => i * (DATA.size[0] + APART) + j;

// The corners of the triangles between pixels that are of one surface.
function surfaceTriangles({ right, down }) {
  const [width, height] = DATA.size;
  const corners = new Uint32Array(6 * width * height);
  let count = 0;
  const add = (...vertices) => {
    corners.set(vertices, count);
    count += 3;
  };
  for (let i = 0; i + 1 < height; i++) {
    for (let j = 0; j + 1 < width; j++) {
      const pixel = i * width + j;
      const [vertex, next] = [vertexOf(i, j), vertexOf(i, j + 1)];
      const [below, diagonal] = [vertexOf(i + 1, j), vertexOf(i + 1, j + 1)];
      if (right[pixel] && down[pixel]) add(vertex, next, below);
      if (right[pixel + width] && down[pixel + 1]) add(next, diagonal, below);
    }
  }
  return corners.subarray(0, count);
}

// The pixels beside a tear, which are drawn one by one.
function tornPixels(inverses, { right, down }) {
  const [width, height] = DATA.size;
  const torn = [];
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const pixel = i * width + j;
      const joinsBeside = (j + 1 === width || right[pixel]) && (j === 0 || right[pixel - 1]);
      const joinsAbove = (i + 1 === height || down[pixel]) && (i === 0 || down[pixel - width]);
      if (!(joinsBeside && joinsAbove) && !Number.isNaN(inverses[pixel])) torn.push(pixel);
    }
  }
  return torn;
}

// The corners of two triangles for each of these pixels: pixels.glsl places four vertices for one.
function pixelTriangles(pixels) {
  const width = DATA.size[0];
  return Uint32Array.from(pixels.flatMap((pixel) => {
    const first = 4 * vertexOf(Math.floor(pixel / width), pixel % width);
    return [first, first + 1, first + 2, first + 2, first + 1, first + 3];
  }));
}

// The rays of the pixels, with 1 in the fourth number of torn ones.
function markedRays(torn) {
  const rays = walk.rays.slice();
  for (const pixel of torn) rays[4 * pixel + 3] = 1;
  return rays;
}

// Bring a source onto the graphics card: colours, inverse distances, and the triangles that hold.
export function upload(source, light, depth) {
  const { gl } = walk;
  const inverses = inverseDistances(depth);
  const joined = joins(inverses);
  const torn = tornPixels(inverses, joined);
  const marked = inverses.map((value) => (Number.isNaN(value) ? -1 : value));
  const image = (format, layout, type, values) =>
    texture(gl, gl.TEXTURE_2D, format, ...DATA.size, 0, layout, type, values);
  Object.assign(source, {
    light: image(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(light.buffer)),
    inverses: image(gl.R32F, gl.RED, gl.FLOAT, marked),
    rays: image(gl.RGBA32F, gl.RGBA, gl.FLOAT, markedRays(torn)),
    surface: triangles(gl, surfaceTriangles(joined)),
    pixels: triangles(gl, pixelTriangles(torn)),
    isThere: true,
  });
}
