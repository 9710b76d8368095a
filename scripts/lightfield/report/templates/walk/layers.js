// Draws an eye's picture: each source into a layer of its own, then the blended layers.

import { DATA } from "../page/data.js";
import { LOOK } from "../page/look.js";
import { viewer } from "../page/state.js";
import { clamp, minus } from "../page/vectors.js";
import { NEAR, metresToEdge } from "./eye.js";
import { DEEPEST, gridStep } from "./coarse.js";
import { rowStride } from "./joins.js";
import { MOST_SOURCES, WALK, walk } from "./state.js";
import { bindTextures, texture } from "./webgl.js";

// Return a framebuffer of two textures, colours and inverse distances. `attach` attaches them.
function framebufferOf(attach) {
  const { gl } = walk;
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  attach();
  gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
  return framebuffer;
}

// Return a picture of light and inverse distances that a shader can draw into.
function createPicture(width, height) {
  const { gl } = walk;
  const image = (format, layout, type) =>
    texture(gl, gl.TEXTURE_2D, format, width, height, 0, layout, type, null);
  const colours = image(gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT);
  const inverses = image(gl.R32F, gl.RED, gl.FLOAT);
  const framebuffer = framebufferOf(() => {
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, colours, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, gl.TEXTURE_2D, inverses, 0);
  });
  return { width, height, colours, inverses, framebuffer };
}

// Return a layer for each source.
function createLayers(width, height) {
  const { gl } = walk;
  const array = (format, layout, type) =>
    texture(gl, gl.TEXTURE_2D_ARRAY, format, width, height, MOST_SOURCES, 0, layout, type, null);
  const colours = array(gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT);
  const inverses = array(gl.R32F, gl.RED, gl.FLOAT);
  const depth = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH24_STENCIL8, width, height);
  const framebuffers = Array.from({ length: MOST_SOURCES }, (_, layer) => framebufferOf(() => {
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, colours, 0, layer);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, inverses, 0, layer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_STENCIL_ATTACHMENT, gl.RENDERBUFFER, depth);
  }));
  return { width, height, colours, inverses, depth, framebuffers };
}

function createStage(width, height, samples) {
  const levels = [];
  for (let [w, h] = [width, height]; ; [w, h] = [Math.ceil(w / 2), Math.ceil(h / 2)]) {
    const level = createPicture(w, h);
    // No coarser level fills the coarsest one, and the finest one is filled when it is shown.
    const isFilledApart = w * h > 1 && levels.length > 0;
    levels.push({ level, filled: isFilledApart ? createPicture(w, h) : level });
    if (w * h === 1) break;
  }
  return { width, height, samples, layers: createLayers(samples * width, samples * height), levels };
}

function deleteStage({ layers, levels }) {
  const { gl } = walk;
  const pictures = levels.flatMap(({ level, filled }) => (level === filled ? [level] : [level, filled]));
  for (const { colours, inverses } of [layers, ...pictures]) {
    gl.deleteTexture(colours);
    gl.deleteTexture(inverses);
  }
  gl.deleteRenderbuffer(layers.depth);
  for (const framebuffer of layers.framebuffers) gl.deleteFramebuffer(framebuffer);
  for (const { framebuffer } of pictures) gl.deleteFramebuffer(framebuffer);
}

// Return the layers and levels for a picture of this size. Keeps two stages: for motion and for still pictures.
function stageOf(width, height, samples) {
  const fits = (stage) => stage.width === width && stage.height === height && stage.samples === samples;
  const stage = walk.stages.find(fits) ?? createStage(width, height, samples);
  walk.stages = [stage, ...walk.stages.filter((other) => other !== stage)];
  if (walk.stages.length > 2) deleteStage(walk.stages.pop());
  return stage;
}

// Draw a part of a source into the bound layer of this width: its surface or its torn pixels. `isSeeming` draws reflections
// where they seem to be.
function drawPart({ linked, uniforms }, { vertices, count, kind }, source, eye, width, isSeeming = false) {
  const { gl } = walk;
  const { view } = source;
  const [right, up, back] = eye.axes;
  gl.useProgram(linked);
  bindTextures(gl, uniforms, {
    rays: [gl.TEXTURE_2D, walk.raysTexture],
    inverses: [gl.TEXTURE_2D, source.inverses],
    light: [gl.TEXTURE_2D, source.light],
  });
  gl.uniform1i(uniforms.stride, rowStride());
  gl.uniform1i(uniforms.gridStep, gridStep());
  // The columns are the source's axes in the world, and the world's axes in the eye.
  gl.uniformMatrix3fv(uniforms.turn, false, [...view.right, ...view.up, ...view.ahead.map((value) => -value)]);
  gl.uniformMatrix3fv(uniforms.back, false, [0, 1, 2].flatMap((axis) => [right[axis], up[axis], back[axis]]));
  gl.uniform3fv(uniforms.offset, minus(view.at, eye.at));
  gl.uniform4fv(uniforms.lens, eye.lens);
  gl.uniform1f(uniforms.near, NEAR);
  gl.uniform1f(uniforms.spread, WALK.distance);
  gl.uniform1f(uniforms.sharp, WALK.sharp);
  gl.uniform1f(uniforms.closest, WALK.closest);
  gl.uniform1f(uniforms.unmoved, WALK.unmoved);
  gl.uniform1i(uniforms.isSeeming, isSeeming);
  gl.uniform1f(uniforms.certain, WALK.certain);
  gl.uniform1f(uniforms.far, WALK.far);
  gl.uniform1f(uniforms.splat, WALK.splat);
  gl.uniform1f(uniforms.splatSame, WALK.splatSame);
  gl.uniform1f(uniforms.deepest, DEEPEST);
  gl.bindVertexArray(vertices);
  gl.uniform1f(uniforms.pointSize, (gridStep() * eye.lens[0] * width * WALK.pixel) / 2);
  gl.drawElements(kind, count, gl.UNSIGNED_INT, 0);
}

// Draw a source's mirrors. Then draw what they reflect where it seems to be, but only on the mirrors.
function drawMirrors(source, eye, width) {
  const { gl } = walk;
  gl.enable(gl.STENCIL_TEST);
  gl.stencilFunc(gl.ALWAYS, 1, 1);
  gl.stencilOp(gl.KEEP, gl.KEEP, gl.REPLACE);
  drawPart(walk.surface, source.mirrors, source, eye, width);
  gl.stencilFunc(gl.EQUAL, 1, 1);
  gl.clearBufferfv(gl.DEPTH, 0, [1]);
  // The inverse distances stay those of the mirror.
  gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.NONE]);
  drawPart(walk.surface, source.mirrors, source, eye, width, true);
  gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
  gl.disable(gl.STENCIL_TEST);
}

function drawSources(layers, eye, isCoarse) {
  const { gl } = walk;
  gl.viewport(0, 0, layers.width, layers.height);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.CULL_FACE);
  gl.depthFunc(gl.LEQUAL);
  gl.frontFace(gl.CW);
  eye.sources.forEach((source, layer) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, layers.framebuffers[layer]);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.COLOR, 1, [-1, 0, 0, 0]);
    gl.clearBufferfi(gl.DEPTH_STENCIL, 0, 1, 0);
    if (isCoarse) {
      drawPart(walk.coarse, source.coarse, source, eye, layers.width, true);
      drawPart(walk.blocks, source.points, source, eye, layers.width, true);
    } else {
      drawPart(walk.surface, source.surface, source, eye, layers.width);
      drawPart(walk.pixels, source.pixels, source, eye, layers.width);
      if (source.mirrors.count) drawMirrors(source, eye, layers.width);
    }
  });
  gl.bindVertexArray(null);
  gl.disable(gl.DEPTH_TEST);
  gl.disable(gl.CULL_FACE);
}

// Set a program up to run over all of a picture. Return its uniforms.
function startPass({ linked, uniforms }, picture, textures) {
  const { gl } = walk;
  gl.bindFramebuffer(gl.FRAMEBUFFER, picture.framebuffer);
  gl.viewport(0, 0, picture.width, picture.height);
  gl.useProgram(linked);
  bindTextures(gl, uniforms, textures);
  gl.uniform1f(uniforms.far, WALK.far);
  return uniforms;
}

const drawTriangle = () => walk.gl.drawArrays(walk.gl.TRIANGLES, 0, 3);

function blendLayers({ layers, levels, samples }, count) {
  const { gl } = walk;
  const uniforms = startPass(walk.blended, levels[0].level, {
    colours: [gl.TEXTURE_2D_ARRAY, layers.colours],
    inverses: [gl.TEXTURE_2D_ARRAY, layers.inverses],
  });
  gl.uniform1i(uniforms.count, count);
  gl.uniform1i(uniforms.samples, samples);
  gl.uniform1f(uniforms.same, WALK.same);
  gl.uniform1f(uniforms.hidden, WALK.hidden);
  gl.uniform1f(uniforms.behind, WALK.behind);
  gl.uniform1f(uniforms.dark, WALK.dark);
  drawTriangle();
}

// Return the textures from which filled.glsl fills a level.
function fillTextures(levels, number) {
  const { gl } = walk;
  const { level } = levels[number];
  // No coarser level fills the coarsest one.
  const coarse = number + 1 < levels.length ? levels[number + 1].filled : level;
  return {
    colours: [gl.TEXTURE_2D, level.colours],
    inverses: [gl.TEXTURE_2D, level.inverses],
    coarseColours: [gl.TEXTURE_2D, coarse.colours],
    coarseInverses: [gl.TEXTURE_2D, coarse.inverses],
  };
}

// Fill the holes of all levels but the finest, each from the next coarser one (push-pull: Gortler et al. 1996).
function fillHoles({ levels }) {
  const { gl } = walk;
  for (let number = 1; number < levels.length; number++) {
    const { colours, inverses } = levels[number - 1].level;
    const textures = { colours: [gl.TEXTURE_2D, colours], inverses: [gl.TEXTURE_2D, inverses] };
    const uniforms = startPass(walk.shrunk, levels[number].level, textures);
    gl.uniform1i(uniforms.isFirst, number === 1);
    drawTriangle();
  }
  for (let number = levels.length - 2; number > 0; number--) {
    const uniforms = startPass(walk.enlarged, levels[number].filled, fillTextures(levels, number));
    gl.uniform1i(uniforms.isFirst, false);
    drawTriangle();
  }
}

// Fill the holes of the finest level, and show it.
function showPicture({ levels }, eye, target, corner, size) {
  const { gl } = walk;
  const { linked, uniforms } = walk.shown;
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.viewport(...corner, ...size);
  gl.useProgram(linked);
  bindTextures(gl, uniforms, {
    ...fillTextures(levels, 0),
    palette: [gl.TEXTURE_2D, walk.palette],
    look: [gl.TEXTURE_3D, walk.lookTexture],
  });
  gl.uniform1i(uniforms.hasLook, LOOK !== null);
  if (LOOK) gl.uniform2f(uniforms.lookRange, LOOK.toe, LOOK.highest);
  gl.uniform1i(uniforms.fillsHoles, WALK.fillsHoles);
  gl.uniform1i(uniforms.isFirst, true);
  gl.uniform1f(uniforms.far, WALK.far);
  gl.uniform1i(uniforms.mode, walk.mode);
  gl.uniform2iv(uniforms.corner, corner);
  gl.uniform1f(uniforms.gain, 2 ** viewer.exposure);
  gl.uniform1f(uniforms.white, DATA.white);
  gl.uniform1f(uniforms.edge, clamp(1 - metresToEdge(eye.at) / Math.max(walk.fadeFrom, NEAR), 0, 0.8));
  gl.uniform2fv(uniforms.shown, DATA.depth.shown);
  drawTriangle();
}

// Draw what an eye sees into `target`, from its `corner` on. The eye has a place (`at`), `axes`, a `lens` (scales and
// shifts across and up), and the `sources` to draw from. `samples` is the number of samples across and down a pixel.
// `isCoarse` draws fewer triangles.
export function drawEye(eye, target, corner, size, samples, isCoarse) {
  const stage = stageOf(...size, samples);
  drawSources(stage.layers, eye, isCoarse);
  blendLayers(stage, eye.sources.length);
  if (WALK.fillsHoles) fillHoles(stage);
  showPicture(stage, eye, target, corner, size);
}
