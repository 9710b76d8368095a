// Starts the walk inside the light field. Like synthesis/view.py, but on the graphics card, it draws the views near the
// eye as surfaces that tear where depth jumps, and blends them.

import { DATA } from "../page/data.js";
import { element } from "../page/document.js";
import { bytesOf, decoded, depthOf } from "../page/packing.js";
import { minus } from "../page/vectors.js";
import { bestViews, missing } from "./choice.js";
import { listen } from "./controls.js";
import { drawWalkSoon } from "./drawing.js";
import { axes, scales } from "./eye.js";
import { goHome, restorePlace } from "./home.js";
import blendedShader from "./shaders/blended.glsl";
import blockShader from "./shaders/block.glsl";
import blocksShader from "./shaders/blocks.glsl";
import coarseShader from "./shaders/coarse.glsl";
import drawnShader from "./shaders/drawn.glsl";
import enlargedShader from "./shaders/enlarged.glsl";
import filledShader from "./shaders/filled.glsl";
import pixelsShader from "./shaders/pixels.glsl";
import placeShader from "./shaders/place.glsl";
import shownShader from "./shaders/shown.glsl";
import shrunkShader from "./shaders/shrunk.glsl";
import splatShader from "./shaders/splat.glsl";
import surfaceShader from "./shaders/surface.glsl";
import wholePictureShader from "./shaders/whole_picture.glsl";
import { unfolded, upload } from "./sources.js";
import { WALK, walk } from "./state.js";
import { program, texture } from "./webgl.js";

// The walk begins with this many sources.
const FIRST = 2;

// Load all sources one after the other, first those that the eye wants. Call `begin` as soon as a few are loaded.
async function loadSources(begin) {
  for (let number = 0; number < walk.order.length; number++) {
    const source = missing() || walk.order.find((other) => !other.isLoaded);
    const { light, depth } = source.entry;
    upload(source, ...(await Promise.all([decoded(light), decoded(depth)])));
    if (number + 1 === Math.min(FIRST, walk.order.length)) begin();
    if (walk.wanted.includes(source) && !missing()) drawWalkSoon();
  }
}

// Return the unit ray of each pixel in the camera's axes: x, y, z, 0.
async function unpackedRays() {
  const pixels = await decoded(WALK.rays);
  const count = pixels.length / 8;
  const coordinate = (pixel) => ((pixels[4 * pixel] << 8) | pixels[4 * pixel + 1]) / 65535;
  const rays = new Float32Array(4 * count);
  for (let pixel = 0; pixel < count; pixel++) {
    rays.set(unfolded(coordinate(pixel), coordinate(count + pixel)), 4 * pixel);
  }
  return rays;
}

function paletteTexture(gl) {
  const colours = new Uint8Array(256 * 4).fill(255);
  bytesOf(DATA.depth.colours).forEach((value, place) => {
    colours[4 * Math.floor(place / 3) + (place % 3)] = value;
  });
  return texture(gl, gl.TEXTURE_2D, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
}

function prepareDrawing(gl) {
  walk.gl = gl;
  walk.surface = program(gl, placeShader + surfaceShader, drawnShader);
  walk.coarse = program(gl, placeShader + surfaceShader, coarseShader);
  walk.blocks = program(gl, placeShader + blocksShader, blockShader);
  walk.pixels = program(gl, placeShader + pixelsShader, splatShader);
  walk.blended = program(gl, wholePictureShader, blendedShader);
  walk.shrunk = program(gl, wholePictureShader, shrunkShader);
  walk.enlarged = program(gl, wholePictureShader, filledShader + enlargedShader);
  walk.shown = program(gl, wholePictureShader, filledShader + shownShader);
  walk.palette = paletteTexture(gl);
}

async function prepareSources() {
  walk.rays = await unpackedRays();
  const { gl } = walk;
  walk.raysTexture = texture(gl, gl.TEXTURE_2D, gl.RGBA32F, ...DATA.size, 0, gl.RGBA, gl.FLOAT, walk.rays);
  walk.toRim = (await decoded(WALK.toRim)).filter((_, place) => place % 4 === 0);
  walk.sight = bytesOf(WALK.sight);
  walk.inverses = Float32Array.from({ length: DATA.depth.steps }, (_, code) => 1 / depthOf(code, DATA.depth.range));
  walk.order = DATA.embedded.map((entry) => ({ entry, view: DATA.views[entry.view] }));
  const places = walk.order.map(({ view }) => view.at);
  walk.extent = Math.max(...places.map((at) => Math.hypot(...minus(at, places[0])))) || 1;
}

async function startWalk() {
  if (!WALK) return;
  const gl = walk.canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl || !gl.getExtension("EXT_color_buffer_float")) {
    element("walk-section").hidden = true;
    return;
  }
  prepareDrawing(gl);
  await prepareSources();
  goHome();
  restorePlace();
  const fieldOfView = scales(walk.canvas.clientWidth, walk.canvas.clientHeight);
  walk.wanted = bestViews(walk.order, walk.sources, walk.at, axes(), fieldOfView);
  await loadSources(() => {
    walk.ready = true;
    listen();
  });
}

startWalk();
