// Starts the walk in a file of its own, with a slider for the exposure.

import { DATA } from "../page/data.js";
import { element } from "../page/document.js";
import { viewer } from "../page/state.js";
import "../walk/main.js";

element("exposure").addEventListener("input", (event) => {
  viewer.exposure = DATA.exposure + Number(event.currentTarget.value);
});
