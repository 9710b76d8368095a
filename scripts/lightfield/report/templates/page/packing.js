// Decodes light and depth. report/packing.py says how they are packed.

import { DATA, MISS } from "./data.js";
import { clamp } from "./vectors.js";

// Return the linear light of each code.
export const lightByCode = ([toe, highest]) =>
  Float64Array.from({ length: 256 }, (_, code) => toe * Math.expm1((code / 255) * Math.log1p(highest / toe)));

export const LIGHT = lightByCode(DATA.light);

export function encodeSrgb(linear) {
  const value = clamp(linear, 0, 1);
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}

export const depthCode = (pixels, at) => ((pixels[at] << 8) | pixels[at + 1]) >> 4;

export function depthOf(code, [low, high]) {
  if (code === 0) return NaN;
  return code === MISS ? Infinity : 2 ** (low + ((code - 1) / (MISS - 2)) * (high - low));
}

export const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

// Return one colour (r, g, b) for each depth code. The codes span `range`.
export function depthColours(range) {
  const bytes = bytesOf(DATA.depth.colours);
  const [near, far] = DATA.depth.shown;
  const table = new Uint8ClampedArray(3 * DATA.depth.steps);
  for (let code = 1; code < MISS; code++) {
    const part = (Math.log2(depthOf(code, range)) - near) / (far - near);
    const colour = 3 * clamp(Math.round(255 * part), 0, 255);
    table.set(bytes.subarray(colour, colour + 3), 3 * code);
  }
  table.fill(176, 3 * MISS);
  return table;
}

export async function decoded(uri) {
  const image = new Image();
  image.src = uri;
  await image.decode();
  const canvas = document.createElement("canvas");
  canvas.width = image.naturalWidth;
  canvas.height = image.naturalHeight;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, canvas.width, canvas.height).data;
}

// Fill `target` from packed pixels, from the pixel `first` on. `develop` writes a pixel from its codes, unless there are
// `colours` of depth codes. Leave pixels of depth 0 transparent.
export function paint(target, light, depth, first, develop, colours) {
  for (let pixel = 0; pixel < target.length; pixel += 4) {
    const source = 4 * first + pixel;
    const code = depth ? depthCode(depth, source) : MISS;
    if (colours) target.set(colours.subarray(3 * code, 3 * code + 3), pixel);
    else develop(light, source, target, pixel);
    target[pixel + 3] = depth && code === 0 ? 0 : 255;
  }
}

export function metres(value) {
  return value === Infinity ? "nothing there" : `${value.toPrecision(value < 1 ? 2 : 3)} m`;
}
