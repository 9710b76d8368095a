"use strict";
// What can be turned, stepped through and pointed at on a dataset's page. How the pictures are
// packed is said in scripts/lightfield/report/packing.py, what `DATA` holds in views.py beside it.

const DATA = JSON.parse(document.getElementById("data").textContent);
const MISS = DATA.depth ? DATA.depth.steps - 1 : 0;

const element = (id) => document.getElementById(id);
const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (start, direction, length) => start.map((value, axis) => value + length * direction[axis]);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

function metres(value) {
  return value === Infinity ? "nothing there" : `${value.toPrecision(value < 1 ? 2 : 3)} m`;
}

// Light and depth out of their codes.

const LIGHT = Float64Array.from({ length: 256 }, (_, code) =>
  code ? 2 ** (DATA.light[0] + ((code - 1) / 254) * (DATA.light[1] - DATA.light[0])) : 0);

function encodeSrgb(linear) {
  const value = clamp(linear, 0, 1);
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}

// Reinhard et al. 2002, equation 4, as the contact sheet is developed.
function developed(exposure) {
  return Uint8ClampedArray.from(LIGHT, (light) => {
    const value = light * 2 ** exposure;
    return 255 * encodeSrgb((value * (1 + value / DATA.white ** 2)) / (1 + value));
  });
}

const depthCode = (pixels, at) => ((pixels[at] << 8) | pixels[at + 1]) >> 4;

function depthOf(code, [low, high]) {
  if (code === 0) return NaN;
  return code === MISS ? Infinity : 2 ** (low + ((code - 1) / (MISS - 2)) * (high - low));
}

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

// One colour (r, g, b) for each depth code, for codes that span `range`.
function depthColours(range) {
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

async function decoded(uri) {
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

// Fill `target` from packed pixels, from the pixel `first` on; where `depth` is 0, leave it clear.
function paint(target, light, depth, first, table, colours) {
  for (let pixel = 0; pixel < target.length; pixel += 4) {
    const source = 4 * first + pixel;
    const code = depth ? depthCode(depth, source) : MISS;
    for (let channel = 0; channel < 3; channel++) {
      target[pixel + channel] = colours ? colours[3 * code + channel] : table[light[source + channel]];
    }
    target[pixel + 3] = depth && code === 0 ? 0 : 255;
  }
}

// Give a canvas as many pixels as the screen has for it; return its context, in CSS pixels.
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  return context;
}

// At most once a frame, however often it is asked for.
function onceAFrame(draw) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  };
}

function pressed(chosen, other) {
  chosen.setAttribute("aria-pressed", "true");
  other.setAttribute("aria-pressed", "false");
}

const row = new Set(DATA.row ? DATA.row.views : []);
const shown = new Set(DATA.embedded.map((entry) => entry.view));

// The viewer.

const viewer = {
  canvas: element("viewer"),
  current: 0,
  exposure: DATA.exposure,
  depth: false,
  cache: new Map(),
  pixels: null,
  pointed: null,
};

async function pixelsOf(number) {
  if (!viewer.cache.has(number)) {
    const entry = DATA.embedded[number];
    viewer.cache.set(number, Promise.all([decoded(entry.light), entry.depth ? decoded(entry.depth) : null]));
    // Some tens of views are kept, so that stepping back and forth is quick.
    if (viewer.cache.size > 32) viewer.cache.delete(viewer.cache.keys().next().value);
  }
  return viewer.cache.get(number);
}

async function open(number) {
  viewer.current = number;
  const view = DATA.views[DATA.embedded[number].view];
  element("view-slider").value = number;
  element("view-name").textContent = view.name;
  for (const button of document.querySelectorAll("[data-step]")) {
    button.disabled = neighbour(button.dataset.step) === null;
  }
  drawRig();
  const pixels = await pixelsOf(number);
  if (viewer.current !== number) return;
  viewer.pixels = pixels;
  drawView();
}

const drawView = onceAFrame(() => {
  if (!viewer.pixels) return;
  const [width, height] = DATA.size;
  const [light, depth] = viewer.pixels;
  const context = viewer.canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const colours = viewer.depth ? viewer.colours : null;
  paint(image.data, light, depth, 0, developed(viewer.exposure), colours);
  context.putImageData(image, 0, 0);
  readOut();
});

function readOut() {
  if (!viewer.pointed || !viewer.pixels) return;
  const [width, height] = DATA.size;
  const [x, y] = viewer.pointed;
  const at = 4 * (y * width + x);
  const [light, depth] = viewer.pixels;
  const place = [
    Math.floor(((x + 0.5) * DATA.resolution[0]) / width),
    Math.floor(((y + 0.5) * DATA.resolution[1]) / height),
  ];
  const radiance = [0, 1, 2].map((channel) => LIGHT[light[at + channel]].toPrecision(2));
  const parts = [["pixel", place.join(", ")], ["radiance R G B", radiance.join("  ")]];
  if (depth) {
    const value = depthOf(depthCode(depth, at), DATA.depth.range);
    const name = DATA.depth.meaning === "z" ? "Z-depth" : "distance";
    parts.push([name, Number.isNaN(value) ? "outside the lens" : metres(value)]);
  }
  const line = element("readout");
  line.replaceChildren();
  for (const [title, value] of parts) {
    const number = document.createElement("b");
    number.textContent = value;
    line.append(`${title} `, number, "   ");
  }
}

// The nearest camera in a direction of the open view's own axes; at an edge, the nearest that is
// turned that way.
function neighbour(step) {
  const from = DATA.views[DATA.embedded[viewer.current].view];
  const sign = step === "left" || step === "down" ? -1 : 1;
  const wanted = (step === "left" || step === "right" ? from.right : from.up).map((value) => sign * value);
  let best = null;
  let turned = null;
  DATA.embedded.forEach((entry, number) => {
    if (number === viewer.current) return;
    const other = DATA.views[entry.view];
    const way = minus(other.at, from.at);
    const length = Math.hypot(...way);
    const towards = length > 1e-6 ? dot(way, wanted) / length : 0;
    // Within 60 degrees; straight ahead counts for more than near.
    if (towards > 0.5 && dot(other.ahead, from.ahead) > -0.2) {
      const cost = length / towards ** 2;
      if (!best || cost < best.cost) best = { cost, number };
    }
    if (dot(other.ahead, wanted) > 0.5 && (!turned || length < turned.length)) turned = { length, number };
  });
  const found = best || turned;
  return found ? found.number : null;
}

function step(direction) {
  const next = neighbour(direction);
  if (next !== null) open(next);
}

// Open a camera's view or, where it is not in the page, that of the one most like it.
function openView(view) {
  const wanted = DATA.views[view];
  let best = { cost: Infinity, number: 0 };
  DATA.embedded.forEach((entry, number) => {
    const other = DATA.views[entry.view];
    const cost = Math.hypot(...minus(other.at, wanted.at)) + rig.extent * (1 - dot(other.ahead, wanted.ahead));
    if (entry.view === view || cost < best.cost) best = { cost: entry.view === view ? -1 : cost, number };
  });
  open(best.number);
}

function pointAtView(event) {
  const frame = viewer.canvas.getBoundingClientRect();
  const [width, height] = DATA.size;
  viewer.pointed = [
    clamp(Math.floor(((event.clientX - frame.left) / frame.width) * width), 0, width - 1),
    clamp(Math.floor(((event.clientY - frame.top) / frame.height) * height), 0, height - 1),
  ];
  readOut();
}

function showExposure() {
  const stops = viewer.exposure - DATA.exposure;
  element("exposure-value").textContent = `${stops < 0 ? "−" : "+"}${Math.abs(stops).toFixed(1)} stops`;
}

function startViewer() {
  const [width, height] = DATA.size;
  viewer.canvas.width = width;
  viewer.canvas.height = height;
  viewer.canvas.style.aspectRatio = `${width} / ${height}`;
  viewer.canvas.addEventListener("pointermove", pointAtView);
  viewer.canvas.addEventListener("pointerdown", pointAtView);
  const slider = element("view-slider");
  slider.max = DATA.embedded.length - 1;
  slider.addEventListener("input", () => open(Number(slider.value)));
  const exposure = element("exposure");
  exposure.addEventListener("input", () => {
    viewer.exposure = DATA.exposure + Number(exposure.value);
    showExposure();
    drawView();
    drawLines();
  });
  showExposure();
  const [light, depth] = [element("show-light"), element("show-depth")];
  const show = (isDepth) => {
    viewer.depth = isDepth;
    pressed(isDepth ? depth : light, isDepth ? light : depth);
    element("depth-scale").hidden = !isDepth;
    drawView();
  };
  light.addEventListener("click", () => show(false));
  depth.addEventListener("click", () => show(true));
  if (DATA.depth) {
    viewer.colours = depthColours(DATA.depth.range);
    startDepthScale();
  } else {
    depth.disabled = true;
    depth.title = "These views have no depth";
  }
  for (const button of document.querySelectorAll("[data-step]")) {
    button.addEventListener("click", () => step(button.dataset.step));
  }
  const keys = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down" };
  for (const canvas of [viewer.canvas, element("rig")]) {
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in keys)) return;
      event.preventDefault();
      step(keys[event.key]);
    });
  }
  open(DATA.first);
}

function startDepthScale() {
  const [near, far] = DATA.depth.shown;
  const context = element("depth-bar").getContext("2d");
  const image = context.createImageData(256, 1);
  const bytes = bytesOf(DATA.depth.colours);
  for (let place = 0; place < 256; place++) {
    for (let channel = 0; channel < 3; channel++) {
      image.data[4 * place + channel] = bytes[3 * place + channel];
    }
    image.data[4 * place + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  for (let tick = 0; tick < 5; tick++) {
    const label = document.createElement("span");
    label.textContent = metres(2 ** (near + (tick / 4) * (far - near)));
    element("depth-ticks").append(label);
  }
}

// The rig in 3D.

// Focal length of the picture of the rig, in lengths of its shorter side.
const SPREAD = 1.75;
const HOME = { turn: 0.55, rise: 0.4, zoom: 1 };
// Beyond this many cameras, lines instead of frusta keep it fluid.
const MOST_FRUSTA = 700;

const rig = { canvas: element("rig"), ...HOME, hover: null, screen: [], pointers: new Map(), moved: 0, points: [], showsPoints: true };

function measureRig() {
  const points = [...DATA.views.map((view) => view.at), ...DATA.outline.flat()];
  const low = [0, 1, 2].map((axis) => points.reduce((least, point) => Math.min(least, point[axis]), Infinity));
  const high = [0, 1, 2].map((axis) => points.reduce((most, point) => Math.max(most, point[axis]), -Infinity));
  rig.center = low.map((value, axis) => (value + high[axis]) / 2);
  rig.extent = Math.max(Math.hypot(...minus(high, low)) / 2, 0.05);
  rig.camera = Math.min(0.14, 1.1 / Math.sqrt(DATA.views.length)) * rig.extent;
}

function projection(width, height) {
  const [sine, cosine] = [Math.sin(rig.turn), Math.cos(rig.turn)];
  const [rise, level] = [Math.sin(rig.rise), Math.cos(rig.rise)];
  const right = [cosine, sine, 0];
  const ahead = [-sine * level, cosine * level, -rise];
  const up = [-sine * rise, cosine * rise, level];
  const distance = (4 * rig.extent) / rig.zoom;
  const scale = SPREAD * Math.min(width, height);
  return (point) => {
    const way = minus(point, rig.center);
    const depth = dot(way, ahead) + distance;
    const size = scale / Math.max(depth, 1e-3 * distance);
    return [width / 2 + dot(way, right) * size, height / 2 - dot(way, up) * size, depth];
  };
}

// The scene as its views' depth has it: a list of places and colours.
function scenePoints() {
  if (!DATA.points) return [];
  const { low, side } = DATA.points;
  const steps = new Uint16Array(bytesOf(DATA.points.places).buffer);
  const colours = bytesOf(DATA.points.colours);
  return Array.from({ length: steps.length / 3 }, (_, number) => {
    const at = low.map((value, axis) => value + (steps[3 * number + axis] / 65535) * side);
    const colour = `rgb(${colours.subarray(3 * number, 3 * number + 3).join(" ")})`;
    return { at, colour, size: 0.012 * (rig.extent + Math.hypot(...minus(at, rig.center))) };
  });
}

// From far to near, each a square that grows with its distance from the rig, as their spacing does.
function drawPoints(context, project, scale) {
  const nearest = (0.5 * 4 * rig.extent) / rig.zoom;
  const drawn = rig.points.map((point) => [...project(point.at), point]);
  drawn.sort((a, b) => b[2] - a[2]);
  for (const [x, y, depth, { colour, size }] of drawn) {
    if (depth < nearest) continue;
    const side = clamp((size * scale) / depth, 1, 3.5);
    context.fillStyle = colour;
    context.fillRect(x - side / 2, y - side / 2, side, side);
  }
}

function polyline(context, points) {
  points.forEach(([x, y], place) => (place ? context.lineTo(x, y) : context.moveTo(x, y)));
}

function drawGround(context, project) {
  const [x, y, z] = rig.center;
  if (z < 0 || z > 3 * rig.extent) return;
  const reach = clamp(Math.ceil(1.5 * rig.extent), 1, 20);
  const middle = [Math.round(x), Math.round(y)];
  context.strokeStyle = themed("--line");
  context.beginPath();
  for (let offset = -reach; offset <= reach; offset++) {
    polyline(context, [-reach, reach].map((end) => project([middle[0] + offset, middle[1] + end, 0])));
    polyline(context, [-reach, reach].map((end) => project([middle[0] + end, middle[1] + offset, 0])));
  }
  context.stroke();
}

function drawAxes(context, project, height) {
  const origin = project(rig.center);
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  ["X", "Y", "Z"].forEach((name, axis) => {
    const unit = [0, 0, 0];
    unit[axis] = 0.01 * rig.extent;
    const tip = project(along(rig.center, unit, 1));
    const length = 28 / ((0.01 * SPREAD * Math.min(rig.canvas.clientWidth, height)) / (4 / rig.zoom));
    const [x, y] = [(tip[0] - origin[0]) * length, (tip[1] - origin[1]) * length];
    context.strokeStyle = context.fillStyle = themed("--soft");
    context.beginPath();
    polyline(context, [[44, height - 44], [44 + x, height - 44 + y]]);
    context.stroke();
    context.fillText(name, 44 + 1.35 * x, height - 44 + 1.35 * y);
  });
}

// What a camera's view is for says more than whether it is in the page or in the row.
function colourOf(number) {
  const { part } = DATA.views[number];
  if (part === "test" || part === "validation") return `--${part}`;
  if (row.has(number)) return "--row";
  return shown.has(number) ? "--shown" : "--faint";
}

function addCamera(context, view, project, simple) {
  const apex = project(view.at);
  if (simple) {
    polyline(context, [apex, project(along(view.at, view.ahead, 1.4 * rig.camera))]);
    return;
  }
  const middle = along(view.at, view.ahead, rig.camera);
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
    project(along(along(middle, view.right, 0.6 * x * rig.camera), view.up, 0.45 * y * rig.camera)));
  polyline(context, [...corners, corners[0]]);
  for (const corner of corners) polyline(context, [apex, corner]);
}

const drawRig = onceAFrame(() => {
  const context = fitted(rig.canvas);
  const [width, height] = [rig.canvas.clientWidth, rig.canvas.clientHeight];
  const project = projection(width, height);
  drawGround(context, project);
  if (rig.showsPoints) drawPoints(context, project, SPREAD * Math.min(width, height));
  rig.screen = DATA.views.map((view) => project(view.at));
  context.strokeStyle = themed("--faint");
  context.beginPath();
  for (const line of DATA.outline) polyline(context, line.map(project));
  context.stroke();

  const current = DATA.embedded[viewer.current].view;
  const simple = DATA.views.length > MOST_FRUSTA;
  const middle = (4 * rig.extent) / rig.zoom;
  const radius = clamp(60 / Math.sqrt(DATA.views.length), 1.2, 3);
  // What is behind is drawn first and paler; one path for all of a colour, for speed.
  for (const behind of [true, false]) {
    context.globalAlpha = behind ? 0.4 : 1;
    for (const colour of ["--faint", "--shown", "--row", "--validation", "--test"]) {
      const among = (number) => colourOf(number) === colour;
      context.strokeStyle = context.fillStyle = themed(colour);
      context.lineWidth = 1;
      context.beginPath();
      DATA.views.forEach((view, number) => {
        if (rig.screen[number][2] > middle === behind && among(number)) addCamera(context, view, project, simple);
      });
      context.stroke();
      DATA.views.forEach((view, number) => {
        if (rig.screen[number][2] > middle !== behind || !among(number)) return;
        const [x, y] = rig.screen[number];
        context.fillRect(x - radius / 2, y - radius / 2, radius, radius);
      });
    }
  }
  context.globalAlpha = 1;
  const marked = [[current, "--current", 2.5]];
  if (rig.hover !== null) marked.push([rig.hover, "--ink", 1.5]);
  for (const [number, colour, thickness] of marked) {
    context.strokeStyle = context.fillStyle = themed(colour);
    context.lineWidth = thickness;
    context.beginPath();
    addCamera(context, DATA.views[number], project, simple);
    context.stroke();
    context.beginPath();
    context.arc(rig.screen[number][0], rig.screen[number][1], 4, 0, 2 * Math.PI);
    context.fill();
  }
  context.lineWidth = 1;
  drawAxes(context, project, height);
  showTip();
});

function showTip() {
  const tip = element("rig-name");
  tip.hidden = rig.hover === null;
  if (tip.hidden) return;
  const [x, y] = rig.screen[rig.hover];
  const { name, part } = DATA.views[rig.hover];
  tip.textContent = part ? `${name} (${part})` : name;
  const half = tip.offsetWidth / 2;
  tip.style.left = `${clamp(x, half, rig.canvas.clientWidth - half)}px`;
  tip.style.top = `${Math.max(y, 40)}px`;
}

// The camera under the pointer: the nearest on screen and, of those, the nearest to the eye.
function cameraAt(event) {
  const frame = rig.canvas.getBoundingClientRect();
  const [x, y] = [event.clientX - frame.left, event.clientY - frame.top];
  let best = { cost: Infinity, number: null };
  rig.screen.forEach(([cameraX, cameraY, depth], number) => {
    const away = Math.hypot(cameraX - x, cameraY - y);
    const cost = away + 2 * (depth / rig.extent);
    if (away < 14 && cost < best.cost) best = { cost, number };
  });
  return best.number;
}

const spread = (pointers) => {
  const [one, other] = [...pointers.values()];
  return Math.hypot(one.x - other.x, one.y - other.y);
};

function startRig() {
  measureRig();
  rig.points = scenePoints();
  const { canvas, pointers } = rig;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    rig.moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) {
      rig.hover = cameraAt(event);
    } else {
      const before = pointers.size === 2 ? spread(pointers) : 0;
      const [x, y] = [event.clientX - last.x, event.clientY - last.y];
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      rig.moved += Math.abs(x) + Math.abs(y);
      if (before) {
        rig.zoom = clamp((rig.zoom * spread(pointers)) / before, 0.05, 20);
      } else {
        rig.turn -= 0.008 * x;
        rig.rise = clamp(rig.rise + 0.008 * y, -Math.PI / 2, Math.PI / 2);
      }
      rig.hover = null;
    }
    drawRig();
  });
  const released = (event) => {
    const still = pointers.delete(event.pointerId) && rig.moved < 5 && event.type === "pointerup";
    const camera = still ? cameraAt(event) : null;
    if (camera === null) return;
    openView(camera);
    viewer.canvas.focus({ preventScroll: true });
  };
  canvas.addEventListener("pointerup", released);
  canvas.addEventListener("pointercancel", released);
  canvas.addEventListener("pointerleave", () => {
    rig.hover = null;
    drawRig();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    rig.zoom = clamp(rig.zoom * Math.exp(-0.0015 * event.deltaY), 0.05, 20);
    drawRig();
  }, { passive: false });
  const toggle = element("show-points");
  if (toggle) {
    toggle.addEventListener("click", () => {
      rig.showsPoints = !rig.showsPoints;
      toggle.setAttribute("aria-pressed", rig.showsPoints);
      drawRig();
    });
  }
  element("rig-reset").addEventListener("click", () => {
    Object.assign(rig, HOME);
    drawRig();
  });
  new ResizeObserver(drawRig).observe(canvas);
}

// The epipolar-plane image.

const lines = { canvas: element("epi"), tilt: 0, depth: false, pixels: null, pointed: null };

function epipolarPixel(x, y) {
  const [count, columns] = DATA.row.shape;
  return (lines.tilt * count + y) * columns + x;
}

const drawLines = onceAFrame(() => {
  if (!lines.pixels) return;
  const [count, columns] = DATA.row.shape;
  const picture = new OffscreenCanvas(columns, count);
  const image = new ImageData(columns, count);
  const colours = lines.depth ? lines.colours : null;
  paint(image.data, lines.pixels[0], lines.pixels[1], epipolarPixel(0, 0), developed(viewer.exposure), colours);
  picture.getContext("2d").putImageData(image, 0, 0);
  const context = fitted(lines.canvas);
  const [width, height] = [lines.canvas.clientWidth, lines.canvas.clientHeight];
  context.imageSmoothingEnabled = false;
  context.drawImage(picture, 0, 0, width, height);
  const track = lines.pointed && DATA.depth ? trace(...lines.pointed) : null;
  if (!track) return;
  for (const [colour, thickness] of [["#000000", 4], ["#ffffff", 1.5]]) {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    let before = null;
    track.forEach((column, place) => {
      const [x, y] = [(column / columns) * width, ((place + 0.5) / count) * height];
      const pixel = Math.floor(column);
      const inside = pixel >= 0 && pixel < columns;
      if (!inside || depthCode(lines.pixels[1], 4 * epipolarPixel(pixel, place)) === 0) {
        before = null;
        return;
      }
      // Round a ring, a curve leaves on one side and comes back on the other.
      if (before === null || Math.abs(column - before) > DATA.row.columns / 2) context.moveTo(x, y);
      else context.lineTo(x, y);
      before = column;
    });
    context.stroke();
  }
});

const angleAt = (x) => (2 * (x + 0.5 + DATA.row.first)) / DATA.row.columns - 1;
const columnAt = (angle) => ((angle + 1) / 2) * DATA.row.columns - DATA.row.first;

// In which column each camera of the row sees the point that is at (x, y), by its depth.
function trace(x, y) {
  const depth = depthOf(depthCode(lines.pixels[1], 4 * epipolarPixel(x, y)), DATA.row.range);
  if (!Number.isFinite(depth)) return null;
  const { kind, places, centers, widest } = DATA.row;
  if (kind === "line") {
    const tangent = angleAt(x) * widest;
    return places.map((place) => columnAt((tangent + (places[y] - place) / depth) / widest));
  }
  const azimuth = angleAt(x) * Math.PI;
  const level = depth * Math.cos((DATA.row.tilts[lines.tilt] * Math.PI) / 180);
  const point = [centers[y][0] + level * Math.sin(azimuth), centers[y][1] + level * Math.cos(azimuth)];
  return centers.map((center) => columnAt(Math.atan2(point[0] - center[0], point[1] - center[1]) / Math.PI));
}

function pointAtLines(event) {
  if (!lines.pixels) return;
  const [count, columns] = DATA.row.shape;
  const frame = lines.canvas.getBoundingClientRect();
  const x = clamp(Math.floor(((event.clientX - frame.left) / frame.width) * columns), 0, columns - 1);
  const y = clamp(Math.floor(((event.clientY - frame.top) / frame.height) * count), 0, count - 1);
  lines.pointed = [x, y];
  rig.hover = DATA.row.rows[y];
  const line = DATA.row.kind === "line";
  const degrees = line ? (Math.atan(angleAt(x) * DATA.row.widest) * 180) / Math.PI : angleAt(x) * 180;
  const parts = [DATA.views[DATA.row.rows[y]].name, `${line ? "angle" : "azimuth"} ${degrees.toFixed(1)}°`];
  if (DATA.depth) {
    const depth = depthOf(depthCode(lines.pixels[1], 4 * epipolarPixel(x, y)), DATA.row.range);
    const name = line ? "perpendicular distance" : "distance";
    parts.push(Number.isNaN(depth) ? "not seen" : `${name} ${metres(depth)}`);
  }
  element("epi-readout").textContent = parts.join("   ");
  drawLines();
  drawRig();
}

async function startLines() {
  if (!DATA.row) return;
  const { tilts } = DATA.row;
  const slider = element("epi-tilt");
  lines.tilt = tilts.indexOf(0);
  slider.max = tilts.length - 1;
  slider.value = lines.tilt;
  const showTilt = () => {
    element("epi-tilt-value").textContent = `${tilts[lines.tilt]}°`.replace("-", "−");
  };
  showTilt();
  slider.addEventListener("input", () => {
    lines.tilt = Number(slider.value);
    showTilt();
    drawLines();
  });
  if (DATA.depth) {
    const [light, depth] = [element("epi-light"), element("epi-depth")];
    lines.colours = depthColours(DATA.row.range);
    const show = (isDepth) => {
      lines.depth = isDepth;
      pressed(isDepth ? depth : light, isDepth ? light : depth);
      drawLines();
    };
    light.addEventListener("click", () => show(false));
    depth.addEventListener("click", () => show(true));
  }
  lines.canvas.addEventListener("pointermove", pointAtLines);
  lines.canvas.addEventListener("pointerdown", (event) => {
    pointAtLines(event);
    if (lines.pointed) openView(DATA.row.rows[lines.pointed[1]]);
  });
  lines.canvas.addEventListener("pointerleave", () => {
    lines.pointed = null;
    rig.hover = null;
    drawLines();
    drawRig();
  });
  new ResizeObserver(drawLines).observe(lines.canvas);
  lines.pixels = await Promise.all([decoded(DATA.row.light), decoded(DATA.row.depth)]);
  drawLines();
}

startRig();
startViewer();
startLines();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawRig);
