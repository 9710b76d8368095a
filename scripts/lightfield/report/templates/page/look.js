// Develops light as the page's pictures are: with Blender's look as a table, or else tone-mapped.

import { DATA } from "./data.js";
import { LIGHT, decoded, encodeSrgb } from "./packing.js";
import { clamp } from "./vectors.js";

export const LOOK = DATA.look;
// The pixels of the look's table. report/packing.py says how they are ordered.
export const lookTable = LOOK ? decoded(LOOK.table) : Promise.resolve(null);

// Tone mapping as in the contact sheet: Reinhard et al. 2002, equation 4.
function toneMapped(light) {
  return 255 * encodeSrgb((light * (1 + light / DATA.white ** 2)) / (1 + light));
}

// Return where light lies in the look's table, in its entries.
function placeInTable(light) {
  const place = Math.log1p(light / LOOK.toe) / Math.log1p(LOOK.highest / LOOK.toe);
  return clamp(place, 0, 1) * (LOOK.side - 1);
}

// Return the function that writes what a look makes of light, given by its places in the table. It interpolates between
// eight entries. It makes no arrays, because it runs for each pixel.
function interpolated(table) {
  const { side } = LOOK;
  const steps = [4 * side * side, 4 * side, 4];
  const lowest = (place) => Math.min(Math.floor(place), side - 2);
  return (red, green, blue, target, at) => {
    const [r, g, b] = [lowest(red), lowest(green), lowest(blue)];
    const first = r * steps[0] + g * steps[1] + b * steps[2];
    for (let channel = 0; channel < 3; channel++) {
      const along = (entry) => table[entry] + (blue - b) * (table[entry + steps[2]] - table[entry]);
      const across = (entry) => along(entry) + (green - g) * (along(entry + steps[1]) - along(entry));
      const entry = first + channel;
      target[at + channel] = across(entry) + (red - r) * (across(entry + steps[0]) - across(entry));
    }
  };
}

// Return the function that develops linear light (r, g, b) into `target` from `at` on.
export function lightDeveloper(table, exposure) {
  const gain = 2 ** exposure;
  const write = table && interpolated(table);
  return (light, target, at) => {
    if (table) write(...light.map((value) => placeInTable(gain * value)), target, at);
    else for (let channel = 0; channel < 3; channel++) target[at + channel] = toneMapped(gain * light[channel]);
  };
}

// Return the function that develops the codes of a packed picture, from the place `source` on.
export function codeDeveloper(table, exposure) {
  const gain = 2 ** exposure;
  if (!table) {
    const shown = Uint8ClampedArray.from(LIGHT, (light) => toneMapped(gain * light));
    return (codes, source, target, at) => {
      for (let channel = 0; channel < 3; channel++) target[at + channel] = shown[codes[source + channel]];
    };
  }
  const places = Float64Array.from(LIGHT, (light) => placeInTable(gain * light));
  const write = interpolated(table);
  return (codes, source, target, at) =>
    write(places[codes[source]], places[codes[source + 1]], places[codes[source + 2]], target, at);
}
