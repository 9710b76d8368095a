// Starts the walk inside the light field. Like synthesis/view.py, but on the graphics card, it draws the views near the
// eye as surfaces that tear where depth jumps, and blends them.

import { DATA } from "../page/data.js";
import { element } from "../page/document.js";
import { LOOK, lookTable } from "../page/look.js";
import { bytesOf, decoded, depthOf } from "../page/packing.js";
import { minus } from "../page/vectors.js";
import { bestViews, missing } from "./choice.js";
import { listen } from "./controls.js";
import { REST, drawWalkSoon, showReadout } from "./drawing.js";
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

// Show a message in place of the picture, or hide it.
function showStatus(message) {
  const status = element("walk-status");
  status.textContent = message;
  status.hidden = !message;
}

// Wait while the eye moves and has all views that it wants, because loading a view holds up the next picture.
async function untilStill() {
  while (!missing() && performance.now() - walk.drawnAt < REST) {
    await new Promise((resolve) => {
      setTimeout(resolve, REST);
    });
  }
}

// Load all sources one after the other, first those that the eye wants. Begin to draw as soon as a few are loaded. A
// graphics card that is lost meanwhile ends this: `restart` loads all sources again.
async function loadSources() {
  walk.loads += 1;
  const thisLoad = walk.loads;
  for (let number = 0; number < walk.order.length; number++) {
    await untilStill();
    if (thisLoad !== walk.loads) return;
    const source = missing() || walk.order.find((other) => !other.isLoaded);
    const { light, depth } = source.entry;
    const pictures = await Promise.all([decoded(light), decoded(depth)]);
    if (thisLoad !== walk.loads) return;
    upload(source, ...pictures);
    if (number + 1 === Math.min(FIRST, walk.order.length)) {
      walk.ready = true;
      showStatus("");
      drawWalkSoon();
    }
    if (walk.wanted.includes(source) && !missing()) drawWalkSoon();
    if (walk.ready) showReadout();
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

// Return the table of the look, between whose entries shaders interpolate. Without a look it has one entry.
function lookTexture(gl, table) {
  const side = LOOK ? LOOK.side : 1;
  const pixels = table || new Uint8Array(4);
  const created = texture(gl, gl.TEXTURE_3D, gl.RGBA8, side, side, side, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  return created;
}

// Let shaders draw into floats. Return null if the graphics card cannot.
const enableFloats = (gl) => gl.getExtension("EXT_color_buffer_float");

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
  walk.lookTexture = lookTexture(gl, walk.lookTable);
}

function uploadRays() {
  const { gl } = walk;
  walk.raysTexture = texture(gl, gl.TEXTURE_2D, gl.RGBA32F, ...DATA.size, 0, gl.RGBA, gl.FLOAT, walk.rays);
}

async function prepareSources() {
  walk.rays = await unpackedRays();
  walk.toRim = (await decoded(WALK.toRim)).filter((_, place) => place % 4 === 0);
  walk.sight = bytesOf(WALK.sight);
  walk.inverses = Float32Array.from({ length: DATA.depth.steps }, (_, code) => 1 / depthOf(code, DATA.depth.range));
  walk.order = DATA.embedded.map((entry) => ({ entry, view: DATA.views[entry.view] }));
  const places = walk.order.map(({ view }) => view.at);
  walk.extent = Math.max(...places.map((at) => Math.hypot(...minus(at, places[0])))) || 1;
}

// Bring everything onto the graphics card again.
function restart() {
  walk.stages = [];
  walk.lastChoice = null;
  for (const source of walk.order) source.isLoaded = false;
  enableFloats(walk.gl);
  prepareDrawing(walk.gl);
  // Without rays `startWalk` has not come so far yet.
  if (!walk.rays) return;
  uploadRays();
  loadSources();
}

// Browsers take the graphics card away from a page: when a phone sleeps, or when many pages use it.
function followLosses() {
  walk.canvas.addEventListener("webglcontextlost", (event) => {
    // Without this the browser does not give the graphics card back.
    event.preventDefault();
    // This ends `loadSources`.
    walk.loads += 1;
    walk.ready = false;
    showStatus("The browser has stopped 3D graphics for now. The walk will continue.");
  });
  walk.canvas.addEventListener("webglcontextrestored", restart);
}

async function startWalk() {
  if (!WALK) return;
  const gl = walk.canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl || !enableFloats(gl)) {
    showStatus("This browser cannot show the walk, because it lacks WebGL 2.");
    element("walk-controls").hidden = true;
    return;
  }
  followLosses();
  walk.lookTable = await lookTable;
  prepareDrawing(gl);
  await prepareSources();
  uploadRays();
  goHome();
  restorePlace();
  const fieldOfView = scales(walk.canvas.clientWidth, walk.canvas.clientHeight);
  walk.wanted = bestViews(walk.order, walk.sources, walk.at, axes(), fieldOfView);
  listen();
  await loadSources();
}

startWalk();
