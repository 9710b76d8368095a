// The state of each figure of the page: what is open, pointed at and turned.

import { DATA } from "./data.js";
import { element } from "./document.js";

export const viewer = {
  canvas: element("viewer"),
  current: 0,
  exposure: DATA.exposure,
  // The table of the look, once it is decoded.
  look: null,
  depth: false,
  sensor: false,
  cache: new Map(),
  pixels: null,
  pointed: null,
};

// The rig's first position: radians around the vertical, radians above the level, and its size.
export const HOME = { turn: 0.55, rise: 0.4, zoom: 1 };

export const rig = {
  canvas: element("rig"),
  ...HOME,
  hover: null,
  screen: [],
  pointers: new Map(),
  moved: 0,
  points: [],
  showsPoints: true,
};

export const lines = {
  canvas: element("epi"),
  tilt: 0,
  depth: false,
  pixels: null,
  pointed: null,
};
