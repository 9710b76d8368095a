"use strict";
// A walk inside the light field: the views near the eye, drawn as surfaces that tear where depth
// jumps, and blended where they show the same. It is scripts/lightfield/synthesis/view.py once
// more, on the graphics card; what DATA.walk holds is said in scripts/lightfield/report/walk.py.

const WALK = DATA.walk;
const MOST_SOURCES = WALK ? WALK.best : 0;
// Of the eye: the nearest that it sees, in metres, and its field of view across the longer side.
const NEAR = 0.01;
const WIDE = (80 * Math.PI) / 180;
const STEEPEST_PITCH = 1.5;
// Between the last vertex of a row and the first of the next so many numbers are left out: what draws
// without a graphics card keeps a vertex by its number modulo 64, where the one below would drop it.
const APART = 32;
// Where a whole picture takes more milliseconds than this, one in motion is made of few sources.
const SLOW = 100;
const FEW = Math.min(2, MOST_SOURCES);
// So many milliseconds after the last motion it stands.
const REST = 200;
const MODES = ["colour", "depth", "holes", "sources"];

const walk = {
  canvas: element("walk"),
  overlay: element("walk-overlay"),
  at: null,
  fadeFrom: 0,
  yaw: 0,
  pitch: 0,
  mode: 0,
  sources: MOST_SOURCES,
  shows: true,
  keys: new Set(),
  frames: 0,
  slow: true,
  wanted: [],
  chosen: [],
};

// Where vertices fall. Positions are in units of their distance from the source, so that what is
// infinitely far is a number as any: clip coordinates are homogeneous.
const SHARED = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D rays, inverses;
uniform sampler2D light;
uniform int stride;
uniform mat3 turn, back;
uniform vec3 offset;
uniform vec4 lens;
uniform vec2 stops;
uniform float near, spread, sharp, tornWeight;
out vec4 shade;
out float nearness;

vec3 decoded(vec3 code) {
  vec3 linear = exp2(stops.x + (code * 255.0 - 1.0) / 254.0 * (stops.y - stops.x));
  return mix(vec3(0.0), linear, step(vec3(0.5 / 255.0), code));
}

void place(ivec2 pixel, vec3 ray, float weight) {
  float inverse = texelFetch(inverses, pixel, 0).r;
  vec3 direction = turn * ray;
  vec3 seen = direction + inverse * offset;
  vec3 eye = back * seen;
  gl_Position = vec4(lens.x * eye.x + lens.z * eye.z, lens.y * eye.y + lens.w * eye.z, -eye.z - 2.0 * near * inverse, -eye.z);
  float here = length(seen);
  float angle = length(seen / here - direction);
  float penalty = angle + spread * max(1.0 / here - 1.0, 0.0) + sharp;
  shade = vec4(decoded(texelFetch(light, pixel, 0).rgb), weight / (penalty * penalty));
  nearness = inverse / here;
}
`;

const SURFACE = `${SHARED}
void main() {
  ivec2 pixel = ivec2(gl_VertexID % stride, gl_VertexID / stride);
  float torn = texelFetch(rays, pixel, 0).a;
  place(pixel, texelFetch(rays, pixel, 0).rgb, torn > 0.5 ? tornWeight : 1.0);
}`;

// Pixels beside a tear, one by one: a corner's ray is the mean of those around it.
const PIXELS = `${SHARED}
// A neighbour that has a ray, or else the pixel itself.
ivec2 beside(ivec2 pixel, ivec2 way) {
  ivec2 other = clamp(pixel + way, ivec2(0), textureSize(rays, 0) - 1);
  return texelFetch(inverses, other, 0).r < 0.0 ? pixel : other;
}
void main() {
  int number = gl_VertexID / 4;
  ivec2 pixel = ivec2(number % stride, number / stride);
  vec3 ray = texelFetch(rays, pixel, 0).rgb;
  ivec2 toLeft = beside(pixel, ivec2(-1, 0)), toRight = beside(pixel, ivec2(1, 0));
  ivec2 above = beside(pixel, ivec2(0, -1)), below = beside(pixel, ivec2(0, 1));
  vec3 across = (texelFetch(rays, toRight, 0).rgb - texelFetch(rays, toLeft, 0).rgb) / float(max(toRight.x - toLeft.x, 1));
  vec3 down = (texelFetch(rays, below, 0).rgb - texelFetch(rays, above, 0).rgb) / float(max(below.y - above.y, 1));
  vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) - 0.5;
  place(pixel, normalize(ray + corner.x * across + corner.y * down), tornWeight);
}`;

const DRAWN = `#version 300 es
precision highp float;
in vec4 shade;
in float nearness;
layout(location = 0) out vec4 colour;
layout(location = 1) out float inverse;
void main() {
  colour = shade;
  inverse = nearness;
}`;

const WHOLE = `#version 300 es
void main() {
  gl_Position = vec4(4 * (gl_VertexID & 1) - 1, 2 * (gl_VertexID & 2) - 1, 0, 1);
}`;

const BLENDED = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
uniform sampler2DArray colours, inverses;
uniform sampler2D palette;
uniform int count, mode;
uniform ivec2 corner;
uniform float gain, white, same, far, edge;
uniform vec2 shown;
out vec4 result;
vec3 encoded(vec3 v) {
  v = clamp(v, 0.0, 1.0);
  return mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), v));
}
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy) - corner;
  float nearest = -1.0, used = 0.0, total = 0.0, mean = 0.0;
  for (int k = 0; k < count; k++) nearest = max(nearest, texelFetch(inverses, ivec3(pixel, k), 0).r);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < count; k++) {
    float inverse = texelFetch(inverses, ivec3(pixel, k), 0).r;
    if (inverse < 0.0 || inverse < nearest - max(same * nearest, far)) continue;
    vec4 drawn = texelFetch(colours, ivec3(pixel, k), 0);
    sum += drawn.a * drawn.rgb;
    mean += drawn.a * inverse;
    total += drawn.a;
    used += 1.0;
  }
  bool hole = nearest < 0.0;
  vec3 v = gain * sum / max(total, 1e-30);
  vec3 colour = hole ? vec3(0.0) : encoded(v * (1.0 + v / (white * white)) / (1.0 + v));
  if (mode == 1) {
    float place = (log2(total / max(mean, 1e-9)) - shown.x) / (shown.y - shown.x);
    colour = hole ? vec3(0.0) : mean <= 0.0 ? vec3(0.69) : texture(palette, vec2(clamp(place, 0.002, 0.998), 0.5)).rgb;
  } else if (mode == 2) {
    colour = hole ? vec3(1.0, 0.0, 0.8) : vec3(dot(colour, vec3(0.3, 0.6, 0.1)) * 0.6);
  } else if (mode == 3) {
    colour = hole ? vec3(0.0) : texture(palette, vec2(used / float(count), 0.5)).rgb;
  }
  // The edge of the volume is felt: colour fades towards it, from where the walk begins at most.
  result = vec4(mix(colour, vec3(dot(colour, vec3(1.0 / 3.0))) * 0.5, edge), 1.0);
}`;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const names = {};
  for (let n = 0; n < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); n++) {
    const { name } = gl.getActiveUniform(made, n);
    names[name] = gl.getUniformLocation(made, name);
  }
  return { made, names };
}

function texture(gl, kind, ...image) {
  const made = gl.createTexture();
  gl.bindTexture(kind, made);
  for (const [name, value] of [["MIN_FILTER", gl.NEAREST], ["MAG_FILTER", gl.NEAREST], ["WRAP_S", gl.CLAMP_TO_EDGE], ["WRAP_T", gl.CLAMP_TO_EDGE]]) {
    gl.texParameteri(kind, gl[`TEXTURE_${name}`], value);
  }
  if (kind === gl.TEXTURE_2D) gl.texImage2D(kind, 0, ...image);
  else gl.texImage3D(kind, 0, ...image);
  return made;
}

// Of the unit square's point, the unit vector (Cigolle et al. 2014).
function unfolded(u, v) {
  let [x, y] = [2 * u - 1, 2 * v - 1];
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x >= 0 ? 1 : -1), (1 - Math.abs(x)) * (y >= 0 ? 1 : -1)];
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

function isSeen([x, y, z]) {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let [u, v] = [x / sum, y / sum];
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u >= 0 ? 1 : -1), (1 - Math.abs(u)) * (v >= 0 ? 1 : -1)];
  const [column, line] = [u, v].map((value) => clamp(Math.floor(((value + 1) / 2) * WALK.side), 0, WALK.side - 1));
  return walk.sight[line * WALK.side + column] === 1;
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

// Bring a source onto the graphics card: colours, inverse distances, and the triangles that hold.
function upload(source, light, depth) {
  const { gl } = walk;
  const [width, height] = DATA.size;
  const inverse = new Float32Array(width * height);
  for (let pixel = 0; pixel < inverse.length; pixel++) {
    const cosine = DATA.depth.meaning === "z" ? -walk.rays[4 * pixel + 2] : 1;
    inverse[pixel] = cosine * walk.inverses[depthCode(depth, 4 * pixel)];
  }
  const at = (i, j) => (i < 0 || j < 0 || i >= height || j >= width ? NaN : inverse[i * width + j]);
  const right = new Uint8Array(width * height);
  const down = new Uint8Array(width * height);
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const a = inverse[i * width + j];
      right[i * width + j] = isOneSurface(at(i, j - 1), a, at(i, j + 1), at(i, j + 2));
      down[i * width + j] = isOneSurface(at(i - 1, j), a, at(i + 1, j), at(i + 2, j));
    }
  }
  const triangles = new Uint32Array(6 * width * height);
  let corners = 0;
  const torn = [];
  const marked = walk.rays.slice();
  for (let i = 0; i < height; i++) {
    for (let j = 0; j < width; j++) {
      const here = i * width + j;
      const [next, below] = [here + 1, here + width];
      const vertex = i * (width + APART) + j;
      const beneath = vertex + width + APART;
      if (i + 1 < height && j + 1 < width) {
        if (right[here] && down[here]) for (const corner of [vertex, vertex + 1, beneath]) triangles[corners++] = corner;
        if (right[below] && down[next]) for (const corner of [vertex + 1, beneath + 1, beneath]) triangles[corners++] = corner;
      }
      const amid = (j + 1 === width || right[here]) && (j === 0 || right[here - 1]) && (i + 1 === height || down[here]) && (i === 0 || down[here - width]);
      if (!amid && !Number.isNaN(inverse[here])) {
        for (const corner of [0, 1, 2, 2, 1, 3]) torn.push(4 * vertex + corner);
        marked[4 * here + 3] = 1;
      }
    }
  }
  const [surface, pixels] = [triangles.subarray(0, corners), Uint32Array.from(torn)].map((indices) => {
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { made, count: indices.length };
  });
  Object.assign(source, {
    light: texture(gl, gl.TEXTURE_2D, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(light.buffer)),
    inverses: texture(gl, gl.TEXTURE_2D, gl.R32F, width, height, 0, gl.RED, gl.FLOAT, inverse.map((value) => (Number.isNaN(value) ? -1 : value))),
    rays: texture(gl, gl.TEXTURE_2D, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, marked),
    surface,
    pixels,
    isThere: true,
  });
}

const missing = () => walk.wanted.find((source) => !source.isThere);

// Bring in all sources one after the other, those first that the eye wants; `begin` as soon as
// a few are there.
async function bringSources(begin) {
  for (let number = 0; number < walk.order.length; number++) {
    const source = missing() || walk.order.find((other) => !other.isThere);
    const { light, depth } = source.entry;
    upload(source, ...(await Promise.all([decoded(light), decoded(depth)])));
    if (number + 1 === Math.min(FEW, walk.order.length)) begin();
    if (walk.wanted.includes(source) && !missing()) drawWalkSoon();
  }
}

const ahead = () => [-Math.sin(walk.yaw) * Math.cos(walk.pitch), Math.cos(walk.yaw) * Math.cos(walk.pitch), Math.sin(walk.pitch)];

// The eye's axes in the world: right, up and back.
function axes() {
  const back = ahead().map((value) => -value);
  const right = [Math.cos(walk.yaw), Math.sin(walk.yaw), 0];
  const up = [-back[2] * right[1], back[2] * right[0], back[0] * right[1] - back[1] * right[0]];
  return [right, up, back];
}

// The views that together see best what the eye looks at: one after the other, that which adds most.
function bestViews(sources, count, at, [right, up, back], [spreadX, spreadY]) {
  const directions = WALK.directions;
  const points = [];
  for (let line = 0; line < directions; line++) {
    for (let column = 0; column < directions; column++) {
      const x = ((column + 0.5) / directions - 0.5) * 2 / spreadX;
      const y = (0.5 - (line + 0.5) / directions) * 2 / spreadY;
      const ray = [0, 1, 2].map((axis) => x * right[axis] + y * up[axis] - back[axis]);
      const length = Math.hypot(...ray);
      points.push(ray.map((value) => value / length));
    }
  }
  const quality = sources.map(({ view }) => WALK.distances.flatMap((distance) => points.map((ray) => {
    const way = minus(along(at, ray, distance), view.at);
    const local = [dot(way, view.right), dot(way, view.up), -dot(way, view.ahead)];
    if (!isSeen(local)) return 0;
    const length = Math.hypot(...way);
    const angle = Math.hypot(...minus(ray, way.map((value) => value / length)));
    return 1 / (angle + WALK.distance * Math.max(length / distance - 1, 0) + WALK.sharp);
  })));
  const chosen = [];
  let worth = quality[0].map(() => 0);
  while (chosen.length < Math.min(count, sources.length)) {
    let best = { gain: -1, number: 0 };
    quality.forEach((own, number) => {
      if (chosen.includes(number)) return;
      const gain = own.reduce((sum, value, n) => sum + Math.log1p(worth[n] + value), 0);
      if (gain > best.gain) best = { gain, number };
    });
    chosen.push(best.number);
    worth = worth.map((value, n) => value + quality[best.number][n]);
  }
  return chosen.map((number) => sources[number]);
}

// Choose what an eye wants to be drawn of, and what it is drawn of while some of that is missing.
function choose(count, ...eye) {
  walk.wanted = bestViews(walk.order, walk.sources, walk.at, ...eye);
  const there = walk.order.filter((source) => source.isThere);
  // They were taken one after the other: the first are the best of fewer, too.
  walk.chosen = missing() ? bestViews(there, count, walk.at, ...eye) : walk.wanted.slice(0, count);
}

// One drawing a source in a layer each, of the size of what is looked at.
function layers(width, height) {
  if (walk.layers && walk.layers.width === width && walk.layers.height === height) return walk.layers;
  const { gl } = walk;
  if (walk.layers) {
    for (const old of [walk.layers.colours, walk.layers.inverses]) gl.deleteTexture(old);
    gl.deleteRenderbuffer(walk.layers.depth);
    for (const old of walk.layers.framebuffers) gl.deleteFramebuffer(old);
  }
  const colours = texture(gl, gl.TEXTURE_2D_ARRAY, gl.RGBA16F, width, height, MOST_SOURCES, 0, gl.RGBA, gl.HALF_FLOAT, null);
  const inverses = texture(gl, gl.TEXTURE_2D_ARRAY, gl.R32F, width, height, MOST_SOURCES, 0, gl.RED, gl.FLOAT, null);
  const depth = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT32F, width, height);
  const framebuffers = Array.from({ length: MOST_SOURCES }, (_, layer) => {
    const made = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, made);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, colours, 0, layer);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, inverses, 0, layer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
    return made;
  });
  walk.layers = { width, height, colours, inverses, depth, framebuffers };
  return walk.layers;
}

function bound(names, textures) {
  const { gl } = walk;
  textures.forEach(([name, kind, made], unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, made);
    gl.uniform1i(names[name], unit);
  });
}

// Draw what an eye sees: `lens` are its scales across and up, and its shifts.
function drawEye(at, eyeAxes, lens, chosen, target, corner, width, height) {
  const { gl } = walk;
  const [right, up, back] = eyeAxes;
  const drawing = layers(width, height);
  gl.viewport(0, 0, width, height);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.CULL_FACE);
  gl.depthFunc(gl.LEQUAL);
  gl.frontFace(gl.CW);
  chosen.forEach((source, layer) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, drawing.framebuffers[layer]);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.COLOR, 1, [-1, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    const { view } = source;
    // Columns: the source's axes in the world.
    const turn = [...view.right, ...view.up, ...view.ahead.map((value) => -value)];
    const turnBack = [0, 1, 2].flatMap((axis) => [right[axis], up[axis], back[axis]]);
    for (const [{ made, names }, vertices] of [[walk.surface, source.surface], [walk.pixels, source.pixels]]) {
      gl.useProgram(made);
      bound(names, [["rays", gl.TEXTURE_2D, source.rays], ["inverses", gl.TEXTURE_2D, source.inverses], ["light", gl.TEXTURE_2D, source.light]]);
      gl.uniform1i(names.stride, DATA.size[0] + APART);
      gl.uniformMatrix3fv(names.turn, false, turn);
      gl.uniformMatrix3fv(names.back, false, turnBack);
      gl.uniform3fv(names.offset, minus(view.at, at));
      gl.uniform4fv(names.lens, lens);
      gl.uniform2fv(names.stops, DATA.light);
      gl.uniform1f(names.near, NEAR);
      gl.uniform1f(names.spread, WALK.distance);
      gl.uniform1f(names.sharp, WALK.sharp);
      gl.uniform1f(names.tornWeight, WALK.torn);
      gl.bindVertexArray(vertices.made);
      gl.drawElements(gl.TRIANGLES, vertices.count, gl.UNSIGNED_INT, 0);
    }
  });
  gl.bindVertexArray(null);
  gl.disable(gl.DEPTH_TEST);
  gl.disable(gl.CULL_FACE);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.viewport(...corner, width, height);
  const { made, names } = walk.blended;
  gl.useProgram(made);
  bound(names, [["colours", gl.TEXTURE_2D_ARRAY, drawing.colours], ["inverses", gl.TEXTURE_2D_ARRAY, drawing.inverses], ["palette", gl.TEXTURE_2D, walk.palette]]);
  gl.uniform1i(names.count, chosen.length);
  gl.uniform1i(names.mode, walk.mode);
  gl.uniform2iv(names.corner, corner);
  gl.uniform1f(names.gain, 2 ** viewer.exposure);
  gl.uniform1f(names.white, DATA.white);
  gl.uniform1f(names.same, WALK.same);
  gl.uniform1f(names.far, WALK.far);
  gl.uniform1f(names.edge, clamp(1 - room(walk.at) / Math.max(walk.fadeFrom, NEAR), 0, 0.8));
  gl.uniform2fv(names.shown, DATA.depth.shown);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

// How far it is from a place to the edge of the volume, in metres; negative beyond.
const room = (at) => Math.min(...WALK.planes.map(([x, y, z, c]) => -(x * at[0] + y * at[1] + z * at[2] + c)));

function kept(at) {
  let place = at;
  for (const [x, y, z, c] of [...WALK.planes, ...WALK.planes]) {
    const beyond = dot([x, y, z], place) + c;
    if (beyond > 0) place = along(place, [x, y, z], -beyond);
  }
  return place;
}

function scales(width, height) {
  const scale = 1 / Math.tan(WIDE / 2);
  return width >= height ? [scale, (scale * width) / height] : [(scale * height) / width, scale];
}

// Draw once, from where the eye is, of so many sources.
function drawWalk(count = walk.sources) {
  const { canvas } = walk;
  const [width, height] = [canvas.width, canvas.height];
  const eye = axes();
  const spread = scales(width, height);
  choose(count, eye, spread);
  drawEye(walk.at, eye, [...spread, 0, 0], walk.chosen, null, [0, 0], width, height);
  drawRoom(eye, spread);
  walk.frames += 1;
}

// Over the picture: the edge of the volume, and the cameras; those in use are marked.
function drawRoom([right, up, back], [spreadX, spreadY]) {
  const context = fitted(walk.overlay);
  const [width, height] = [walk.overlay.clientWidth, walk.overlay.clientHeight];
  const project = (point) => {
    const way = minus(point, walk.at);
    const depth = -dot(way, back);
    if (depth < NEAR) return null;
    return [(width / 2) * (1 + (spreadX * dot(way, right)) / depth), (height / 2) * (1 - (spreadY * dot(way, up)) / depth)];
  };
  if (walk.shows) {
    context.strokeStyle = "rgb(255 255 255 / 35%)";
    context.beginPath();
    for (const line of DATA.outline) {
      let before = null;
      for (const point of line.map(project)) {
        if (before && point) polyline(context, [before, point]);
        before = point;
      }
    }
    context.stroke();
    for (const source of walk.order) {
      const point = project(source.view.at);
      if (!point) continue;
      const used = walk.chosen.includes(source);
      context.fillStyle = used ? "#e69f00" : "rgb(255 255 255 / 60%)";
      context.fillRect(point[0] - 2, point[1] - 2, used ? 6 : 4, used ? 6 : 4);
    }
  }
  const metresLeft = room(walk.at);
  element("walk-readout").textContent =
    `${walk.at.map((value) => (Math.round(100 * value) / 100 + 0).toFixed(2)).join(", ")} m · ${metresLeft.toFixed(2)} m to the edge · ${walk.chosen.length} of ${walk.order.length} views`;
}

const drawWalkSoon = onceAFrame(() => {
  if (!walk.ready) return;
  drawWalk(walk.slow ? FEW : walk.sources);
  clearTimeout(walk.rest);
  if (walk.slow) walk.rest = setTimeout(drawWhole, REST);
});

// Draw of all sources, and see how long that takes: it is done when a pixel can be read.
function drawWhole() {
  if (missing()) return;
  const { gl } = walk;
  const start = performance.now();
  drawWalk();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  walk.slow = performance.now() - start > SLOW;
}

function moved(forward, sideways, upwards) {
  const [right] = axes();
  const level = [-Math.sin(walk.yaw), Math.cos(walk.yaw), 0];
  const way = [0, 1, 2].map((axis) => forward * level[axis] + sideways * right[axis] + (axis === 2 ? upwards : 0));
  walk.at = kept(along(walk.at, way, walk.extent));
  drawWalkSoon();
}

function turned(x, y) {
  walk.yaw -= x;
  walk.pitch = clamp(walk.pitch - y, -STEEPEST_PITCH, STEEPEST_PITCH);
  drawWalkSoon();
}

const WALKING = { w: [1, 0, 0], s: [-1, 0, 0], a: [0, -1, 0], d: [0, 1, 0], e: [0, 0, 1], q: [0, 0, -1], ArrowUp: [1, 0, 0], ArrowDown: [-1, 0, 0] };
const TURNING = { ArrowLeft: [-1, 0], ArrowRight: [1, 0] };

function walkOn(before) {
  requestAnimationFrame((now) => {
    const seconds = clamp((now - before) / 1000, 0, 0.1);
    for (const key of walk.keys) {
      if (key in WALKING) moved(...WALKING[key].map((value) => 0.6 * seconds * value));
      else turned(...TURNING[key].map((value) => 1.2 * seconds * value));
    }
    if (walk.keys.size) walkOn(now);
  });
}

function showMode(mode) {
  walk.mode = mode;
  MODES.forEach((name, number) => element(`walk-${name}`).setAttribute("aria-pressed", number === mode));
  drawWalkSoon();
}

function listen() {
  const { overlay } = walk;
  const pointers = new Map();
  overlay.addEventListener("pointerdown", (event) => {
    overlay.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    overlay.focus({ preventScroll: true });
  });
  overlay.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const way = [event.clientX - last[0], event.clientY - last[1]];
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    const side = Math.max(overlay.clientWidth, overlay.clientHeight);
    // One finger looks around, two walk.
    if (pointers.size === 1) turned(...way.map((value) => (-value * WIDE) / side));
    else moved((0.5 * way[1]) / side, (-0.5 * way[0]) / side, 0);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    overlay.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  overlay.addEventListener("wheel", (event) => {
    event.preventDefault();
    moved(-0.0005 * event.deltaY, 0, 0);
  }, { passive: false });
  overlay.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!(key in WALKING || key in TURNING)) return;
    event.preventDefault();
    if (!walk.keys.size) walkOn(performance.now());
    walk.keys.add(key);
  });
  overlay.addEventListener("keyup", (event) => walk.keys.delete(event.key.length === 1 ? event.key.toLowerCase() : event.key));
  overlay.addEventListener("blur", () => walk.keys.clear());
  MODES.forEach((name, mode) => element(`walk-${name}`).addEventListener("click", () => showMode(mode)));
  element("walk-cameras").addEventListener("click", (event) => {
    walk.shows = !walk.shows;
    event.currentTarget.setAttribute("aria-pressed", walk.shows);
    drawWalkSoon();
  });
  element("walk-home").addEventListener("click", goHome);
  const slider = element("walk-frame");
  if (slider) {
    const name = () => slider.dataset.frames.split(" ")[Number(slider.value)];
    slider.addEventListener("input", () => { slider.nextElementSibling.textContent = name(); });
    slider.addEventListener("change", () => { location.href = `../../${name()}/report/index.html${placeHash()}`; });
  }
  element("exposure").addEventListener("input", drawWalkSoon);
  new ResizeObserver(() => {
    const ratio = Math.min(window.devicePixelRatio || 1, 1.5);
    walk.canvas.width = Math.max(2, Math.round(walk.canvas.clientWidth * ratio));
    walk.canvas.height = Math.max(2, Math.round(walk.canvas.clientHeight * ratio));
    drawWalkSoon();
  }).observe(walk.canvas);
  listenForHeadset();
}

// A headset: each eye is drawn as the page is, from where the head is in the volume.
function listenForHeadset() {
  const button = element("walk-headset");
  if (!navigator.xr) return;
  navigator.xr.isSessionSupported("immersive-vr").then((can) => { button.hidden = !can; }, () => {});
  button.addEventListener("click", async () => {
    const { gl } = walk;
    await gl.makeXRCompatible();
    const session = await navigator.xr.requestSession("immersive-vr");
    session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl) });
    const space = await session.requestReferenceSpace("local");
    const start = walk.at;
    const draw = (_, frame) => {
      session.requestAnimationFrame(draw);
      const pose = frame.getViewerPose(space);
      if (!pose) return;
      const layer = session.renderState.baseLayer;
      for (const view of pose.views) {
        const { x, y, width, height } = layer.getViewport(view);
        const m = view.transform.matrix;
        // WebXR's Y is up, its −Z ahead: ours are Z and Y.
        const world = (column) => [m[4 * column], -m[4 * column + 2], m[4 * column + 1]];
        const eye = [world(0), world(1), world(2)];
        walk.at = kept(minus(start, world(3).map((value) => -value)));
        const p = view.projectionMatrix;
        choose(walk.sources, eye, [p[0], p[5]]);
        drawEye(walk.at, eye, [p[0], p[5], p[8], p[9]], walk.chosen, layer.framebuffer, [x, y], width, height);
      }
    };
    session.requestAnimationFrame(draw);
    session.addEventListener("end", drawWalkSoon);
  });
}

// Another frame of a sequence is another page, which goes on from where the eye was.
const PLACE = "#walk=";
const placeHash = () => PLACE + [...walk.at, walk.yaw, walk.pitch, walk.mode].join(",");

function goWhereItWas() {
  if (!location.hash.startsWith(PLACE)) return;
  const [x, y, z, yaw, pitch, mode] = location.hash.slice(PLACE.length).split(",").map(Number);
  if (![x, y, z, yaw, pitch].every(Number.isFinite) || !(mode in MODES)) return;
  Object.assign(walk, { at: kept([x, y, z]), yaw, pitch });
  showMode(mode);
  element("walk-section").scrollIntoView();
}

// The walk begins where the cameras see something: amid them, unless they look inwards. Amid those
// is what they look at, so it begins before one of them, and looks as that does.
function goHome() {
  const views = walk.order.map(({ view }) => view);
  const mean = (vectors) => [0, 1, 2].map((axis) => vectors.reduce((sum, vector) => sum + vector[axis], 0) / vectors.length);
  const centre = mean(views.map((view) => view.at));
  const first = DATA.views[DATA.embedded[DATA.first].view];
  const inwards = views.map((view) => {
    const way = minus(centre, view.at);
    return dot(view.ahead, way) / (Math.hypot(...way) || 1);
  });
  const lookInwards = inwards.reduce((sum, value) => sum + value, 0) > views.length / 2;
  const lookAlike = Math.hypot(...mean(views.map((view) => view.ahead))) > 0.5;
  // Away from the edge, but not into what is seen.
  const step = Math.min(walk.extent, WALK.nearest) / 4;
  walk.at = kept(lookInwards ? along(first.at, first.ahead, step) : centre);
  walk.yaw = Math.hypot(first.ahead[0], first.ahead[1]) > 0.1 ? Math.atan2(-first.ahead[0], first.ahead[1]) : 0;
  walk.pitch = lookInwards || lookAlike ? clamp(Math.asin(clamp(first.ahead[2], -1, 1)), -STEEPEST_PITCH, STEEPEST_PITCH) : 0;
  walk.fadeFrom = Math.min(walk.extent / 4, room(walk.at));
  drawWalkSoon();
}

async function startWalk() {
  if (!WALK) return;
  const gl = walk.canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl || !gl.getExtension("EXT_color_buffer_float")) {
    element("walk-section").hidden = true;
    return;
  }
  walk.gl = gl;
  walk.surface = program(gl, SURFACE, DRAWN);
  walk.pixels = program(gl, PIXELS, DRAWN);
  walk.blended = program(gl, WHOLE, BLENDED);
  const codes = new Uint16Array(bytesOf(WALK.rays).buffer);
  walk.rays = new Float32Array(2 * codes.length);
  for (let pixel = 0; pixel < codes.length / 2; pixel++) {
    walk.rays.set(unfolded(codes[2 * pixel] / 65535, codes[2 * pixel + 1] / 65535), 4 * pixel);
  }
  walk.sight = bytesOf(WALK.sight);
  walk.inverses = Float32Array.from({ length: DATA.depth.steps }, (_, code) => 1 / depthOf(code, DATA.depth.range));
  const colours = new Uint8Array(256 * 4).fill(255);
  bytesOf(DATA.depth.colours).forEach((value, place) => { colours[4 * Math.floor(place / 3) + (place % 3)] = value; });
  walk.palette = texture(gl, gl.TEXTURE_2D, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
  walk.order = DATA.embedded.map((entry) => ({ entry, view: DATA.views[entry.view] }));
  const places = walk.order.map(({ view }) => view.at);
  walk.extent = Math.max(...places.map((at) => Math.hypot(...minus(at, places[0])))) || 1;
  goHome();
  goWhereItWas();
  walk.wanted = bestViews(walk.order, walk.sources, walk.at, axes(), scales(walk.canvas.clientWidth, walk.canvas.clientHeight));
  await bringSources(() => {
    walk.ready = true;
    listen();
  });
}

startWalk();
