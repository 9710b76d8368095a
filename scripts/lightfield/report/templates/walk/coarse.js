// Makes the triangles and points of a view for pictures in motion: few, whatever the size of the view.

import { DATA } from "../page/data.js";
import { joins, vertexOf } from "./joins.js";
import { WALK } from "./state.js";

// The grid has about this many pixels along its longer side. The pixels of a picture in motion are hardly smaller.
const LONGEST = 200;
// A flat block of at most this many pixels along a side is drawn as two triangles.
const LARGEST_BLOCK = 8;
// A block is flat if its inverse distances differ from the two triangles' by less than this part.
const FLAT = 0.03;
// A point shows pixels whose inverse distances differ by at most this part.
export const DEEPEST = 0.25;

// Return the distance of the grid's pixels in the view.
export const gridStep = () => Math.max(1, Math.round(Math.max(...DATA.size) / LONGEST));

// Return the values of the grid's pixels.
function onGrid(values) {
  const step = gridStep();
  const [width, height] = DATA.size;
  const picked = new values.constructor(Math.ceil(width / step) * Math.ceil(height / step));
  let place = 0;
  for (let i = 0; i < height; i += step) {
    for (let j = 0; j < width; j += step) picked[place++] = values[i * width + j];
  }
  return picked;
}

// Return the same `joins`, torn at the edges of mirrors.
function tornAtMirrors({ right, down }, steps, width) {
  const isMirror = (pixel) => steps[pixel] > 0;
  return {
    right: right.map((joined, pixel) => joined && isMirror(pixel) === isMirror(pixel + 1)),
    down: down.map((joined, pixel) => joined && isMirror(pixel) === isMirror(pixel + width)),
  };
}

// Return whether all quads of a block are complete, and the block is flat enough for two triangles.
function isFlat({ inverses, isComplete, width }, first, side) {
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

// Return the corners of triangles. Flat blocks of 8, 4 or 2 pixels have two.
function coarseTriangles(grid) {
  const { width, height, upper, lower, vertex } = grid;
  const corners = [];
  const addBlock = (i, j, side) => {
    if (i + 1 >= height || j + 1 >= width) return;
    const pixel = i * width + j;
    const fits = i + side < height && j + side < width;
    if (side > 1 && !(fits && isFlat(grid, pixel, side))) {
      const half = side / 2;
      for (const [line, column] of [[0, 0], [0, half], [half, 0], [half, half]]) addBlock(i + line, j + column, half);
      return;
    }
    const [next, below, diagonal] = [vertex(i, j + side), vertex(i + side, j), vertex(i + side, j + side)];
    if (side > 1 || upper(pixel)) corners.push(vertex(i, j), next, below);
    if (side > 1 || lower(pixel)) corners.push(next, diagonal, below);
  };
  for (let i = 0; i < height; i += LARGEST_BLOCK) {
    for (let j = 0; j < width; j += LARGEST_BLOCK) addBlock(i, j, LARGEST_BLOCK);
  }
  return Uint32Array.from(corners);
}

// Return the vertices of the nearest pixel in the block of the grid from row `top` and column `left` on, and of the
// farthest one if it is on another surface.
function blockVertices(inverses, top, left) {
  const [width, height] = DATA.size;
  const [right, bottom] = [Math.min(left + gridStep(), width), Math.min(top + gridStep(), height)];
  let [nearest, farthest] = [null, null];
  for (let i = top; i < bottom; i++) {
    for (let j = left; j < right; j++) {
      const pixel = { inverse: inverses[i * width + j], vertex: vertexOf(i, j) };
      if (Number.isNaN(pixel.inverse)) continue;
      if (!nearest || pixel.inverse > nearest.inverse) nearest = pixel;
      if (!farthest || pixel.inverse < farthest.inverse) farthest = pixel;
    }
  }
  if (!nearest) return [];
  return farthest.inverse < (1 - DEEPEST) * nearest.inverse ? [nearest.vertex, farthest.vertex] : [nearest.vertex];
}

// Return the vertices of the points for the grid's pixels with few of the six triangles around them. The gaps between the
// surfaces of a coarse grid are so wide that points must cover them, too.
function pointVertices({ width, height, upper, lower, block }) {
  const hasUpper = (i, j) => i >= 0 && j >= 0 && upper(i * width + j);
  const hasLower = (i, j) => i >= 0 && j >= 0 && lower(i * width + j);
  const fewest = gridStep() > 1 ? 4 : 1;
  const vertices = [];
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const triangles = [
        hasUpper(i, j), hasUpper(i, j - 1), hasUpper(i - 1, j),
        hasLower(i - 1, j - 1), hasLower(i, j - 1), hasLower(i - 1, j),
      ];
      if (triangles.filter(Boolean).length < fewest) vertices.push(...block(i, j));
    }
  }
  return Uint32Array.from(vertices);
}

// Return the corners of triangles and the vertices of points. `seeming` are the inverse distances of where
// reflections seem to be, `steps` tell where mirrors are.
export function coarseShapes(seeming, steps) {
  const step = gridStep();
  const [width, height] = DATA.size.map((side) => Math.ceil(side / step));
  const inverses = onGrid(seeming);
  const { right, down } = tornAtMirrors(joins(inverses, [width, height], step), onGrid(steps), width);
  const upper = (pixel) => right[pixel] && down[pixel];
  const lower = (pixel) => right[pixel + width] && down[pixel + 1];
  const grid = {
    width,
    height,
    inverses,
    upper,
    lower,
    isComplete: (pixel) => upper(pixel) && lower(pixel),
    vertex: (i, j) => vertexOf(step * i, step * j),
    block: (i, j) => blockVertices(seeming, step * i, step * j),
  };
  return { triangles: coarseTriangles(grid), points: pointVertices(grid) };
}
