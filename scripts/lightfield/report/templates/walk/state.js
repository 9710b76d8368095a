// The state of the walk: the eye, the mode, and the chosen sources. report/walk.py says what `DATA.walk` holds.

import { DATA } from "../page/data.js";
import { element } from "../page/document.js";

export const WALK = DATA.walk;
export const MOST_SOURCES = WALK ? WALK.best : 0;
export const MODES = ["colour", "depth", "holes", "sources"];

export const walk = {
  canvas: element("walk"),
  overlay: element("walk-overlay"),
  // The pixels across and down of a still picture.
  size: [2, 2],
  at: null,
  fadeFrom: 0,
  yaw: 0,
  pitch: 0,
  mode: 0,
  sources: MOST_SOURCES,
  showsCameras: false,
  // What each held key does, by its place on the keyboard.
  keys: new Map(),
  isMoving: false,
  frames: 0,
  // The table of the look. null without one.
  lookTable: null,
  ready: false,
  order: [],
  // How often loading has begun, or has ended because the graphics card was lost.
  loads: 0,
  // When the last picture was drawn after a motion, in milliseconds.
  drawnAt: -Infinity,
  stages: [],
  zoom: 1,
  slow: true,
  wanted: [],
  chosen: [],
  choices: 0,
  lastChoice: null,
};
