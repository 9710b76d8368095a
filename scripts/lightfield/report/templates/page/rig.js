// Lets the user turn the rig in 3D, and point at its cameras.

import { distanceOfTwo, element } from "./document.js";
import { drawRig, measureRig, scenePoints } from "./rig_drawing.js";
import { HOME, rig, viewer } from "./state.js";
import { clamp } from "./vectors.js";
import { openView } from "./viewer.js";

// Return the camera under the pointer: the nearest on screen, and among those the nearest to the eye.
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

const zoomTo = (value) => {
  rig.zoom = clamp(value, 0.05, 20);
};

function pointerDown(event) {
  // A right button opens a menu, which may swallow the button's release.
  if (event.button !== 0) return;
  rig.canvas.setPointerCapture(event.pointerId);
  rig.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  rig.moved = 0;
}

// One pointer turns the rig, two zoom. Without a pressed button, name the camera under the pointer.
function pointerMove(event) {
  const { pointers } = rig;
  const last = pointers.get(event.pointerId);
  if (!last) {
    rig.hover = cameraAt(event);
    drawRig();
    return;
  }
  const before = pointers.size === 2 ? distanceOfTwo(pointers) : 0;
  const [x, y] = [event.clientX - last.x, event.clientY - last.y];
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  rig.moved += Math.abs(x) + Math.abs(y);
  if (before) {
    zoomTo((rig.zoom * distanceOfTwo(pointers)) / before);
  } else {
    rig.turn -= 0.008 * x;
    rig.rise = clamp(rig.rise + 0.008 * y, -Math.PI / 2, Math.PI / 2);
  }
  rig.hover = null;
  drawRig();
}

// A pointer that hardly moved opens the camera under it.
function pointerUp(event) {
  const isClick = rig.pointers.delete(event.pointerId) && rig.moved < 5 && event.type === "pointerup";
  const camera = isClick ? cameraAt(event) : null;
  if (camera === null) return;
  openView(camera);
  viewer.canvas.focus({ preventScroll: true });
}

function pointerLeave() {
  rig.hover = null;
  drawRig();
}

function turnWheel(event) {
  // The wheel scrolls the page until the user has clicked the rig.
  if (document.activeElement !== rig.canvas) return;
  event.preventDefault();
  zoomTo(rig.zoom * Math.exp(-0.0015 * event.deltaY));
  drawRig();
}

function startPointsButton() {
  const button = element("show-points");
  if (!button) return;
  button.addEventListener("click", () => {
    rig.showsPoints = !rig.showsPoints;
    button.setAttribute("aria-pressed", rig.showsPoints);
    drawRig();
  });
}

export function startRig() {
  measureRig();
  rig.points = scenePoints();
  const { canvas } = rig;
  canvas.addEventListener("pointerdown", pointerDown);
  canvas.addEventListener("pointermove", pointerMove);
  canvas.addEventListener("pointerup", pointerUp);
  canvas.addEventListener("pointercancel", pointerUp);
  canvas.addEventListener("pointerleave", pointerLeave);
  canvas.addEventListener("wheel", turnWheel, { passive: false });
  startPointsButton();
  element("rig-reset").addEventListener("click", () => {
    Object.assign(rig, HOME);
    drawRig();
  });
  new ResizeObserver(drawRig).observe(canvas);
}
