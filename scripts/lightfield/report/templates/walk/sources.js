// Brings a source view onto the graphics card: its colours, inverse distances and triangles.

import { DATA } from "../page/data.js";
import { LIGHT, depthCode } from "../page/packing.js";
import { coarseShapes } from "./coarse.js";
import { joins, vertexOf } from "./joins.js";
import { WALK, walk } from "./state.js";
import { drawable, texture } from "./webgl.js";

const ROOTS = LIGHT.map(Math.sqrt);

// Return the unit vector of an octahedral point in the unit square (Cigolle et al. 2014).
export function unfolded(u, v) {
  let [x, y] = [2 * u - 1, 2 * v - 1];
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x >= 0 ? 1 : -1), (1 - Math.abs(x)) * (y >= 0 ? 1 : -1)];
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

// Return by how many steps each pixel's inverse distance is too large for a reflection.
const stepsFarther = (depth) => Uint8Array.from({ length: depth.length / 4 }, (_, pixel) => depth[4 * pixel + 1] & 15);

// Return each pixel's inverse distance from the camera, NaN outside the lens.
function inverseDistances(depth) {
  const [width, height] = DATA.size;
  const inverses = new Float32Array(width * height);
  for (let pixel = 0; pixel < inverses.length; pixel++) {
    const cosine = DATA.depth.meaning === "z" ? -walk.rays[4 * pixel + 2] : 1;
    inverses[pixel] = cosine * walk.inverses[depthCode(depth, 4 * pixel)];
  }
  return inverses;
}

// Return the corners of the triangles between pixels on one surface: those of mirrors, and all others.
function surfaceTriangles({ right, down }, steps) {
  const [width, height] = DATA.size;
  const matte = new Uint32Array(6 * width * height);
  const mirrors = [];
  let count = 0;
  const add = (isMirror, a, b, c) => {
    if (isMirror) mirrors.push(a, b, c);
    else {
      matte[count] = a;
      matte[count + 1] = b;
      matte[count + 2] = c;
      count += 3;
    }
  };
  const areMirrors = (a, b, c) => steps[a] > 0 && steps[b] > 0 && steps[c] > 0;
  for (let i = 0; i + 1 < height; i++) {
    for (let j = 0; j + 1 < width; j++) {
      const pixel = i * width + j;
      const lower = pixel + width;
      const [vertex, next] = [vertexOf(i, j), vertexOf(i, j + 1)];
      const [below, diagonal] = [vertexOf(i + 1, j), vertexOf(i + 1, j + 1)];
      if (right[pixel] && down[pixel]) add(areMirrors(pixel, pixel + 1, lower), vertex, next, below);
      if (right[lower] && down[pixel + 1]) add(areMirrors(pixel + 1, lower + 1, lower), next, diagonal, below);
    }
  }
  return { matte: matte.subarray(0, count), mirrors: Uint32Array.from(mirrors) };
}

// Return the pixels without all of the triangles that fit into the picture around them. They are drawn one by one.
function tornPixels(inverses, { right, down }) {
  const [width, height] = DATA.size;
  // Whether the quad right of and below a pixel has its upper left triangle, and its lower right one.
  const upper = (pixel) => right[pixel] && down[pixel];
  const lower = (pixel) => right[pixel + width] && down[pixel + 1];
  const torn = [];
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const pixel = i * width + j;
      const [hasLeft, hasRight, hasAbove, hasBelow] = [j > 0, j + 1 < width, i > 0, i + 1 < height];
      const hasAllTriangles =
        (!(hasRight && hasBelow) || upper(pixel)) && (!(hasLeft && hasAbove) || lower(pixel - width - 1)) &&
        (!(hasLeft && hasBelow) || (upper(pixel - 1) && lower(pixel - 1))) &&
        (!(hasRight && hasAbove) || (upper(pixel - width) && lower(pixel - width)));
      if (!hasAllTriangles && !Number.isNaN(inverses[pixel])) torn.push(pixel);
    }
  }
  return torn;
}

// Return the corners of two triangles for each of these pixels. pixels.glsl places a pixel's four vertices.
function pixelTriangles(pixels) {
  const width = DATA.size[0];
  return Uint32Array.from(pixels.flatMap((pixel) => {
    const first = 4 * vertexOf(Math.floor(pixel / width), pixel % width);
    return [first, first + 1, first + 2, first + 2, first + 1, first + 3];
  }));
}

// Return the roots of a picture's colours, sharpened as by `sharpen` in synthesis/kernels.py. The fourth number is the
// certainty of each pixel.
function sharpRoots(light, { right, down }, torn) {
  const [width, height] = DATA.size;
  const roots = Float32Array.from(light, (code) => ROOTS[code]);
  const sharp = new Float32Array(roots.length);
  const part = WALK.sharpened / 4;
  for (let pixel = 0; pixel < width * height; pixel++) {
    const [j, row] = [pixel % width, 4 * width];
    const [joinsLeft, joinsAbove] = [j > 0 && right[pixel - 1], pixel >= width && down[pixel - width]];
    for (let at = 4 * pixel; at < 4 * pixel + 3; at++) {
      let difference = 0;
      if (right[pixel]) difference += roots[at + 4] - roots[at];
      if (joinsLeft) difference += roots[at - 4] - roots[at];
      if (down[pixel]) difference += roots[at + row] - roots[at];
      if (joinsAbove) difference += roots[at - row] - roots[at];
      sharp[at] = Math.max(roots[at] - part * difference, 0);
    }
    sharp[4 * pixel + 3] = walk.toRim[pixel] / 255;
  }
  // The mixed colours beside a tear stay as they are.
  for (const pixel of torn) {
    for (let at = 4 * pixel; at < 4 * pixel + 3; at++) sharp[at] = roots[at];
    sharp[4 * pixel + 3] *= WALK.torn;
  }
  return sharp;
}

// Bring a source onto the graphics card: colours, inverse distances and triangles.
export function upload(source, light, depth) {
  const { gl } = walk;
  const inverses = inverseDistances(depth);
  const steps = stepsFarther(depth);
  const joined = joins(inverses, DATA.size, 1);
  const torn = tornPixels(inverses, joined);
  const seeming = inverses.map((value, pixel) => value * (1 - steps[pixel] / WALK.steps));
  const { triangles, points } = coarseShapes(seeming, steps);
  const pairs = new Float32Array(2 * inverses.length);
  inverses.forEach((value, pixel) => {
    const isHit = !Number.isNaN(value);
    pairs[2 * pixel] = isHit ? value : -1;
    pairs[2 * pixel + 1] = isHit ? seeming[pixel] : -1;
  });
  const { matte, mirrors } = surfaceTriangles(joined, steps);
  const shapes = (corners) => drawable(gl, gl.TRIANGLES, corners);
  const image = (format, layout, values) =>
    texture(gl, gl.TEXTURE_2D, format, ...DATA.size, 0, layout, gl.FLOAT, values);
  const roots = image(gl.RGBA16F, gl.RGBA, sharpRoots(light, joined, torn));
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  Object.assign(source, {
    light: roots,
    inverses: image(gl.RG32F, gl.RG, pairs),
    surface: shapes(matte),
    mirrors: shapes(mirrors),
    pixels: shapes(pixelTriangles(torn)),
    coarse: shapes(triangles),
    points: drawable(gl, gl.POINTS, points),
    isLoaded: true,
  });
}
