// Draws both eyes for a headset, from the head's place in the volume.

import { element } from "../page/document.js";
import { along } from "../page/vectors.js";
import { IN_MOTION, choose } from "./choice.js";
import { drawWalkSoon } from "./drawing.js";
import { insideVolume } from "./eye.js";
import { drawEye } from "./layers.js";
import { walk } from "./state.js";

// Draw both eyes of a headset's frame. `start` is the eye's place when the session began.
function drawHeadset(session, space, start, frame) {
  const pose = frame.getViewerPose(space);
  if (!pose) return;
  const layer = session.renderState.baseLayer;
  for (const view of pose.views) {
    const { x, y, width, height } = layer.getViewport(view);
    const matrix = view.transform.matrix;
    // In WebXR Y is up and −Z is ahead. Here Z is up and Y is ahead.
    const column = (number) => [matrix[4 * number], -matrix[4 * number + 2], matrix[4 * number + 1]];
    const axes = [column(0), column(1), column(2)];
    walk.at = insideVolume(along(start, column(3), 1));
    const p = view.projectionMatrix;
    choose(walk.sources, axes, [p[0], p[5]], IN_MOTION);
    const eye = { at: walk.at, axes, lens: [p[0], p[5], p[8], p[9]], sources: walk.chosen };
    drawEye(eye, layer.framebuffer, [x, y], [width, height], 1, false);
  }
}

async function startSession() {
  const { gl } = walk;
  await gl.makeXRCompatible();
  const session = await navigator.xr.requestSession("immersive-vr");
  session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl) });
  const space = await session.requestReferenceSpace("local");
  const start = walk.at;
  const draw = (_, frame) => {
    session.requestAnimationFrame(draw);
    drawHeadset(session, space, start, frame);
  };
  session.requestAnimationFrame(draw);
  session.addEventListener("end", drawWalkSoon);
}

export function listenForHeadset() {
  const button = element("walk-headset");
  if (!navigator.xr) return;
  const show = (isSupported) => {
    button.hidden = !isSupported;
  };
  navigator.xr.isSessionSupported("immersive-vr").then(show, () => {});
  button.addEventListener("click", startSession);
}
