// The page's elements, canvases and colours.

export const element = (id) => document.getElementById(id);
export const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Give a canvas as many pixels as the screen has for it; return its context, in CSS pixels.
export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  return context;
}

// Return a function that schedules `draw` for the next frame, at most once a frame.
export function onceAFrame(draw) {
  let isScheduled = false;
  return () => {
    if (isScheduled) return;
    isScheduled = true;
    requestAnimationFrame(() => {
      isScheduled = false;
      draw();
    });
  };
}

// Make two buttons a choice. `show` is called with whether depth is chosen.
export function chooseDepth(light, depth, show) {
  for (const [isDepth, button, other] of [[false, light, depth], [true, depth, light]]) {
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", "true");
      other.setAttribute("aria-pressed", "false");
      show(isDepth);
    });
  }
}

export function polyline(context, points) {
  points.forEach(([x, y], place) => (place ? context.lineTo(x, y) : context.moveTo(x, y)));
}

// Return the distance between two fingers, at least a pixel. The zoom follows from a quotient.
export const distanceOfTwo = (pointers) => {
  const [first, second] = [...pointers.values()];
  return Math.max(Math.hypot(first.x - second.x, first.y - second.y), 1);
};
