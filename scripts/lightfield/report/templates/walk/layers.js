// What an eye sees: each source drawn into a layer of its own, and the layers blended.

import { DATA } from "../page/data.js";
import { viewer } from "../page/state.js";
import { clamp, minus } from "../page/vectors.js";
import { NEAR, metresToEdge } from "./eye.js";
import { APART } from "./sources.js";
import { MOST_SOURCES, WALK, walk } from "./state.js";
import { bindTextures, texture } from "./webgl.js";

function deleteLayers({ colours, inverses, depth, framebuffers }) {
  const { gl } = walk;
  gl.deleteTexture(colours);
  gl.deleteTexture(inverses);
  gl.deleteRenderbuffer(depth);
  for (const framebuffer of framebuffers) gl.deleteFramebuffer(framebuffer);
}

// A layer for each source, of the size of the picture.
function layersOfSize(width, height) {
  const old = walk.layers;
  if (old && old.width === width && old.height === height) return old;
  if (old) deleteLayers(old);
  const { gl } = walk;
  const array = (format, layout, type) =>
    texture(gl, gl.TEXTURE_2D_ARRAY, format, width, height, MOST_SOURCES, 0, layout, type, null);
  const colours = array(gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT);
  const inverses = array(gl.R32F, gl.RED, gl.FLOAT);
  const depth = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT32F, width, height);
  const framebuffers = Array.from({ length: MOST_SOURCES }, (_, layer) => {
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, colours, 0, layer);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, inverses, 0, layer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
    return framebuffer;
  });
  walk.layers = { width, height, colours, inverses, depth, framebuffers };
  return walk.layers;
}

// Draw one part of a source, its surface or its torn pixels, into the layer that is bound.
function drawPart({ linked, uniforms }, { vertices, count }, source, eye) {
  const { gl } = walk;
  const { view } = source;
  const [right, up, back] = eye.axes;
  gl.useProgram(linked);
  bindTextures(gl, uniforms, {
    rays: [gl.TEXTURE_2D, source.rays],
    inverses: [gl.TEXTURE_2D, source.inverses],
    light: [gl.TEXTURE_2D, source.light],
  });
  gl.uniform1i(uniforms.stride, DATA.size[0] + APART);
  // Columns: the source's axes in the world, and the world's axes in the eye.
  gl.uniformMatrix3fv(uniforms.turn, false, [...view.right, ...view.up, ...view.ahead.map((value) => -value)]);
  gl.uniformMatrix3fv(uniforms.back, false, [0, 1, 2].flatMap((axis) => [right[axis], up[axis], back[axis]]));
  gl.uniform3fv(uniforms.offset, minus(view.at, eye.at));
  gl.uniform4fv(uniforms.lens, eye.lens);
  gl.uniform2fv(uniforms.stops, DATA.light);
  gl.uniform1f(uniforms.near, NEAR);
  gl.uniform1f(uniforms.spread, WALK.distance);
  gl.uniform1f(uniforms.sharp, WALK.sharp);
  gl.uniform1f(uniforms.tornWeight, WALK.torn);
  gl.bindVertexArray(vertices);
  gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
}

function drawSources(layers, eye) {
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
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    drawPart(walk.surface, source.surface, source, eye);
    drawPart(walk.pixels, source.pixels, source, eye);
  });
  gl.bindVertexArray(null);
  gl.disable(gl.DEPTH_TEST);
  gl.disable(gl.CULL_FACE);
}

function blendLayers(layers, eye, target, corner) {
  const { gl } = walk;
  const { linked, uniforms } = walk.blended;
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.viewport(...corner, layers.width, layers.height);
  gl.useProgram(linked);
  bindTextures(gl, uniforms, {
    colours: [gl.TEXTURE_2D_ARRAY, layers.colours],
    inverses: [gl.TEXTURE_2D_ARRAY, layers.inverses],
    palette: [gl.TEXTURE_2D, walk.palette],
  });
  gl.uniform1i(uniforms.count, eye.sources.length);
  gl.uniform1i(uniforms.mode, walk.mode);
  gl.uniform2iv(uniforms.corner, corner);
  gl.uniform1f(uniforms.gain, 2 ** viewer.exposure);
  gl.uniform1f(uniforms.white, DATA.white);
  gl.uniform1f(uniforms.same, WALK.same);
  gl.uniform1f(uniforms.far, WALK.far);
  gl.uniform1f(uniforms.edge, clamp(1 - metresToEdge(eye.at) / Math.max(walk.fadeFrom, NEAR), 0, 0.8));
  gl.uniform2fv(uniforms.shown, DATA.depth.shown);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

// Draw what an eye sees into `target`, from its `corner` on. Of the eye: where it is (`at`), its `axes`, its
// `lens` (scales across and up, and shifts), and the `sources` that it is drawn from.
export function drawEye(eye, target, corner, width, height) {
  const layers = layersOfSize(width, height);
  drawSources(layers, eye);
  blendLayers(layers, eye, target, corner);
}
