// Tells which neighbouring pixels of a view are on one surface, and numbers the vertices of its triangles.

import { DATA } from "../page/data.js";
import { WALK } from "./state.js";

// Return the number of vertex numbers from one row to the next. A software renderer caches vertices by their number modulo
// 64. With this number a vertex rarely replaces one of the rows above it that is still needed.
export const rowStride = () => 64 * Math.ceil(DATA.size[0] / 64) + 40;

// Return the number of a pixel's vertex.
export const vertexOf = (i, j) => i * rowStride() + j;

// Return whether two neighbours a and b in a row of inverse distances, `step` pixels apart, are on one surface.
function isOneSurface(before, a, b, after, step) {
  const difference = b - a;
  if (Number.isNaN(difference)) return false;
  if (Math.abs(difference) <= Math.max(step * WALK.steepest * Math.max(a, b), WALK.far)) return true;
  if (Math.min(a, b) === 0) return false;
  const even = WALK.even * Math.abs(difference);
  return Math.abs(a - before - difference) < even && Math.abs(after - b - difference) < even;
}

// Return for each pixel of a grid whether it shares a surface with the one on its right, and with the one below. `step` is
// the distance of the grid's pixels in the view.
export function joins(inverses, [width, height], step) {
  const at = (i, j) => (i < 0 || j < 0 || i >= height || j >= width ? NaN : inverses[i * width + j]);
  const right = new Uint8Array(width * height);
  const down = new Uint8Array(width * height);
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const pixel = i * width + j;
      right[pixel] = isOneSurface(at(i, j - 1), at(i, j), at(i, j + 1), at(i, j + 2), step);
      down[pixel] = isOneSurface(at(i - 1, j), at(i, j), at(i + 1, j), at(i + 2, j), step);
    }
  }
  return { right, down };
}
