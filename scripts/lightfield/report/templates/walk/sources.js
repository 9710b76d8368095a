// Brings a source view onto the graphics card: its colours, inverse distances and triangles.

import { DATA } from "../page/data.js";
import { LIGHT, depthCode } from "../page/packing.js";
import { WALK, walk } from "./state.js";
import { drawable, texture } from "./webgl.js";

// This many vertex numbers stay unused after each row. A software renderer caches vertices by their number modulo 64.
// Without the gap, a vertex would often replace the one above it there.
export const ROW_GAP = 32;

// In motion, a flat block of at most this many pixels along a side is drawn as two triangles.
const LARGEST_BLOCK = 8;
// A block is flat if its inverse distances differ from the two triangles' by less than this part.
const FLAT = 0.03;

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

// Return whether two neighbours a and b in a row of inverse distances are on one surface.
function isOneSurface(before, a, b, after) {
  const step = b - a;
  if (Number.isNaN(step)) return false;
  if (Math.abs(step) <= Math.max(WALK.steepest * Math.max(a, b), WALK.far)) return true;
  if (Math.min(a, b) === 0) return false;
  const even = WALK.even * Math.abs(step);
  return Math.abs(a - before - step) < even && Math.abs(after - b - step) < even;
}

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

// Return for each pixel whether it shares a surface with the pixel on its right, and with the one below.
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

// Return the same `joins`, torn at the edges of mirrors.
function tornAtMirrors({ right, down }, steps) {
  const width = DATA.size[0];
  const isMirror = (pixel) => steps[pixel] > 0;
  return {
    right: right.map((joined, pixel) => joined && isMirror(pixel) === isMirror(pixel + 1)),
    down: down.map((joined, pixel) => joined && isMirror(pixel) === isMirror(pixel + width)),
  };
}

// Return the number of a pixel's vertex.
const vertexOf = (i, j) => i * (DATA.size[0] + ROW_GAP) + j;

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

// Return whether all quads of a block are complete, and the block is flat enough for two triangles.
function isFlat(inverses, isComplete, first, side) {
  const width = DATA.size[0];
  for (let line = 0; line < side; line++) {
    for (let column = 0; column < side; column++) if (!isComplete(first + line * width + column)) return false;
  }
  // Two triangles replace eight here, which nobody sees in motion.
  if (side === 2) return true;
  const corner = (i, j) => inverses[first + i * side * width + j * side];
  for (let i = 0; i <= 2; i++) {
    for (let j = 0; j <= 2; j++) {
      const expected =
        ((2 - i) * ((2 - j) * corner(0, 0) + j * corner(0, 1)) + i * ((2 - j) * corner(1, 0) + j * corner(1, 1))) / 4;
      const here = inverses[first + ((i * side) / 2) * width + (j * side) / 2];
      if (Math.abs(here - expected) > Math.max(FLAT * here, WALK.far)) return false;
    }
  }
  return true;
}

// Return the corners of fewer triangles, for pictures in motion. Flat blocks of 8, 4 or 2 pixels have two.
function coarseTriangles(inverses, { right, down }) {
  const [width, height] = DATA.size;
  const corners = [];
  const upper = (pixel) => right[pixel] && down[pixel];
  const lower = (pixel) => right[pixel + width] && down[pixel + 1];
  const isComplete = (pixel) => upper(pixel) && lower(pixel);
  const addBlock = (i, j, side) => {
    if (i + 1 >= height || j + 1 >= width) return;
    const pixel = i * width + j;
    const fits = i + side < height && j + side < width;
    if (side > 1 && !(fits && isFlat(inverses, isComplete, pixel, side))) {
      const half = side / 2;
      for (const [line, column] of [[0, 0], [0, half], [half, 0], [half, half]]) addBlock(i + line, j + column, half);
      return;
    }
    const [next, below, diagonal] = [vertexOf(i, j + side), vertexOf(i + side, j), vertexOf(i + side, j + side)];
    if (side > 1 || upper(pixel)) corners.push(vertexOf(i, j), next, below);
    if (side > 1 || lower(pixel)) corners.push(next, diagonal, below);
  };
  for (let i = 0; i < height; i += LARGEST_BLOCK) {
    for (let j = 0; j < width; j += LARGEST_BLOCK) addBlock(i, j, LARGEST_BLOCK);
  }
  return Uint32Array.from(corners);
}

// Return the pixels without any triangle around them. In motion, only they are drawn one by one.
function lonePixels(inverses, { right, down }) {
  const [width, height] = DATA.size;
  const upper = (i, j) => i >= 0 && j >= 0 && right[i * width + j] && down[i * width + j];
  const lower = (i, j) => i >= 0 && j >= 0 && right[(i + 1) * width + j] && down[i * width + j + 1];
  const lone = [];
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const hasTriangle =
        upper(i, j) || lower(i - 1, j - 1) || upper(i, j - 1) || lower(i, j - 1) || upper(i - 1, j) || lower(i - 1, j);
      if (!hasTriangle && !Number.isNaN(inverses[i * width + j])) lone.push(i * width + j);
    }
  }
  return lone;
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

// Return the vertices of these pixels.
function pixelVertices(pixels) {
  const width = DATA.size[0];
  return Uint32Array.from(pixels, (pixel) => vertexOf(Math.floor(pixel / width), pixel % width));
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
  const joined = joins(inverses);
  const torn = tornPixels(inverses, joined);
  const seeming = inverses.map((value, pixel) => value * (1 - steps[pixel] / WALK.steps));
  const parted = tornAtMirrors(joined, steps);
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
    coarse: shapes(coarseTriangles(seeming, parted)),
    points: drawable(gl, gl.POINTS, pixelVertices(lonePixels(seeming, parted))),
    isLoaded: true,
  });
}
