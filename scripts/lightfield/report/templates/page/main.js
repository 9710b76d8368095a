// What can be turned, stepped through and pointed at on a dataset's page.

import { startLines } from "./epipolar.js";
import { startRig } from "./rig.js";
import { drawRig } from "./rig_drawing.js";
import { startViewer } from "./viewer.js";

startRig();
startViewer();
startLines();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawRig);
