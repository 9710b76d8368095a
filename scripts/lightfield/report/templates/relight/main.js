// Relights a view: sums the pictures of its light groups, each with the strength and colour that
// the user chooses. The sum is linear, and then developed as the views are.

import { DATA } from "../page/data.js";
import { element, onceAFrame } from "../page/document.js";
import { lightDeveloper, lookTable } from "../page/look.js";
import { decoded, lightByCode } from "../page/packing.js";
import { viewer } from "../page/state.js";

const LIGHTS = DATA.lights;
// One entry for each group: its linear light by code, its codes, and its factors of R, G and B.
const lamps = LIGHTS.groups.map((group) => ({
  light: lightByCode(group.scale),
  codes: null,
  factors: [1, 1, 1],
}));

const drawLit = onceAFrame(() => {
  const [width, height] = LIGHTS.size;
  const total = new Float32Array(4 * width * height);
  for (const lamp of lamps) {
    if (!lamp.codes || !lamp.factors.some((factor) => factor > 0)) continue;
    for (let channel = 0; channel < 3; channel++) {
      const factor = lamp.factors[channel];
      for (let place = channel; place < total.length; place += 4) {
        total[place] += factor * lamp.light[lamp.codes[place]];
      }
    }
  }
  const context = element("lit").getContext("2d");
  const image = context.createImageData(width, height);
  const develop = lightDeveloper(viewer.look, LIGHTS.exposure + Number(element("lit-exposure").value));
  for (let place = 0; place < total.length; place += 4) {
    develop([total[place], total[place + 1], total[place + 2]], image.data, place);
    image.data[place + 3] = 255;
  }
  context.putImageData(image, 0, 0);
});

// Return the linear value of one of the hexadecimal channels of an sRGB colour, as in #ff8000.
function channelOf(colour, channel) {
  const value = parseInt(colour.slice(1 + 2 * channel, 3 + 2 * channel), 16) / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

function takeLight(number) {
  const strength = Number(element(`light-${number}`).value);
  const colour = element(`light-colour-${number}`).value;
  lamps[number].factors = [0, 1, 2].map((channel) => strength * channelOf(colour, channel));
  element(`light-value-${number}`).textContent = `× ${strength.toFixed(2)}`;
  drawLit();
}

function setStrength(number, strength) {
  element(`light-${number}`).value = strength;
  takeLight(number);
}

// Set all lights back to white at strength 1, or turn off all but one of them.
function resetLights(only) {
  lamps.forEach((_, number) => {
    element(`light-colour-${number}`).value = "#ffffff";
    setStrength(number, only === undefined || only === number ? 1 : 0);
  });
}

async function startLights() {
  const canvas = element("lit");
  [canvas.width, canvas.height] = LIGHTS.size;
  canvas.style.aspectRatio = `${canvas.width} / ${canvas.height}`;
  LIGHTS.groups.forEach((group, number) => {
    element(`light-${number}`).addEventListener("input", () => takeLight(number));
    element(`light-colour-${number}`).addEventListener("input", () => takeLight(number));
    element(`light-only-${number}`).addEventListener("click", () => resetLights(number));
  });
  element("lit-exposure").addEventListener("input", drawLit);
  element("lit-reset").addEventListener("click", () => resetLights());
  const pictures = await Promise.all(LIGHTS.groups.map((group) => decoded(group.light)));
  pictures.forEach((codes, number) => {
    lamps[number].codes = codes;
  });
  viewer.look = await lookTable;
  canvas.setAttribute("aria-busy", "false");
  drawLit();
}

startLights();
