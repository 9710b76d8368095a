// Shows the refocused picture that the slider chooses, at the viewer's exposure.

import { DATA } from "../page/data.js";
import { element, onceAFrame } from "../page/document.js";
import { codeDeveloper, lookTable } from "../page/look.js";
import { decoded, metres, paint } from "../page/packing.js";
import { viewer } from "../page/state.js";

const FOCUS = DATA.focus;
// The codes of the pictures that were shown, by number, and the number of the chosen one.
const focused = { codes: new Map(), current: Math.floor(FOCUS.pictures.length / 2) };

const drawFocused = onceAFrame(async () => {
  const number = focused.current;
  if (!focused.codes.has(number)) focused.codes.set(number, decoded(FOCUS.pictures[number]));
  const [codes, table] = await Promise.all([focused.codes.get(number), lookTable]);
  if (number !== focused.current) return;
  const canvas = element("focused");
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, canvas.height);
  paint(image.data, codes, null, 0, codeDeveloper(table, viewer.exposure), null);
  context.putImageData(image, 0, 0);
  canvas.setAttribute("aria-busy", "false");
});

function chooseFocus(number) {
  focused.current = number;
  const distance = metres(FOCUS.distances[number]);
  element("focus-value").textContent = distance;
  element("focus").setAttribute("aria-valuetext", distance);
  drawFocused();
}

function startFocus() {
  const canvas = element("focused");
  [canvas.width, canvas.height] = FOCUS.size;
  canvas.style.aspectRatio = `${canvas.width} / ${canvas.height}`;
  const slider = element("focus");
  slider.max = FOCUS.pictures.length - 1;
  slider.value = focused.current;
  slider.addEventListener("input", () => chooseFocus(Number(slider.value)));
  element("exposure").addEventListener("input", drawFocused);
  chooseFocus(focused.current);
}

startFocus();
