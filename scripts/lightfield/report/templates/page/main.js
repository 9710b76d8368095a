// Starts the figures of a dataset's page that the user can turn, step through and point at.

import { startLines } from "./epipolar.js";
import { startRig } from "./rig.js";
import { drawRig } from "./rig_drawing.js";
import { startViewer } from "./viewer.js";

startRig();
startViewer();
startLines();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawRig);
