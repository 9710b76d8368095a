// Listens to the walk's buttons, keys and pointers.

import { distanceOfTwo, element } from "../page/document.js";
import { drawWalkSoon } from "./drawing.js";
import { fieldOfView } from "./eye.js";
import { listenForHeadset } from "./headset.js";
import { goHome, placeHash, showMode } from "./home.js";
import { TURNING, WALKING, ZOOMING, keepMoving, moveEye, turnEye, zoomBy } from "./motion.js";
import { MODES, walk } from "./state.js";

// One finger turns the eye. Two fingers move it, and zoom as they part.
function listenToPointers(overlay) {
  const pointers = new Map();
  overlay.addEventListener("pointerdown", (event) => {
    // A right button opens a menu, which may swallow the button's release.
    if (event.button !== 0) return;
    overlay.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    overlay.focus({ preventScroll: true });
  });
  overlay.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const before = pointers.size === 2 ? distanceOfTwo(pointers) : 0;
    const [x, y] = [event.clientX - last.x, event.clientY - last.y];
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const side = Math.max(overlay.clientWidth, overlay.clientHeight);
    const wide = fieldOfView(...walk.size) / walk.zoom;
    if (pointers.size === 1) turnEye((-x * wide) / side, (-y * wide) / side);
    else moveEye((0.5 * y) / side, (-0.5 * x) / side, 0);
    if (before) zoomBy(distanceOfTwo(pointers) / before);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    overlay.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  const followWheel = (event) => {
    // The wheel scrolls the page until the user has clicked the picture.
    if (document.activeElement !== overlay) return;
    event.preventDefault();
    // A browser reports a pinch on a touchpad as the wheel with the control key.
    if (event.ctrlKey) zoomBy(Math.exp(-0.01 * event.deltaY));
    else moveEye(-0.0005 * event.deltaY, 0, 0);
  };
  overlay.addEventListener("wheel", followWheel, { passive: false });
}

const keyOf = (event) => (event.key.length === 1 ? event.key.toLowerCase() : event.key);

function listenToKeys(overlay) {
  overlay.addEventListener("keydown", (event) => {
    // With these keys the browser does something else: it zooms the page, or marks all of it.
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = keyOf(event);
    if (!(key in WALKING || key in TURNING || key in ZOOMING)) return;
    event.preventDefault();
    // The release of a key may have another `key`, if Shift was released before. Its `code` stays the same.
    walk.keys.set(event.code, key);
    keepMoving();
  });
  overlay.addEventListener("keyup", (event) => {
    walk.keys.delete(event.code);
    // On macOS, keys that are released while Command is held have no keyup.
    if (event.key === "Meta") walk.keys.clear();
  });
  overlay.addEventListener("blur", () => walk.keys.clear());
}

function listenToButtons() {
  MODES.forEach((name, mode) => element(`walk-${name}`).addEventListener("click", () => showMode(mode)));
  element("walk-cameras").addEventListener("click", (event) => {
    walk.showsCameras = !walk.showsCameras;
    event.currentTarget.setAttribute("aria-pressed", walk.showsCameras);
    drawWalkSoon();
  });
  element("walk-home").addEventListener("click", goHome);
  element("exposure").addEventListener("input", drawWalkSoon);
}

// Each frame of a sequence is a page of its own: the slider opens it.
function listenToFrames() {
  const slider = element("walk-frame");
  if (!slider) return;
  const name = () => slider.dataset.frames.split(" ")[Number(slider.value)];
  slider.addEventListener("input", () => {
    slider.nextElementSibling.textContent = name();
  });
  slider.addEventListener("change", () => {
    location.href = `../../${name()}/report/index.html${placeHash()}`;
  });
}

function followSize() {
  const ratio = Math.min(window.devicePixelRatio || 1, 1.5);
  walk.size = [ratio * walk.canvas.clientWidth, ratio * walk.canvas.clientHeight];
  drawWalkSoon();
}

export function listen() {
  listenToPointers(walk.overlay);
  listenToKeys(walk.overlay);
  listenToButtons();
  listenToFrames();
  new ResizeObserver(followSize).observe(walk.canvas);
  listenForHeadset();
}
