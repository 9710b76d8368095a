// Plays the frames of a sequence, and shows them as another camera sees them.

const links = [...document.querySelectorAll("#frames a")];
const images = links.map((link) => link.querySelector("img"));
// The pictures of each camera. The page's own images have those of the camera that is shown first.
const pictures = JSON.parse(document.getElementById("pictures").textContent).map((row) =>
  row.length ? row : images.map((image) => image.src),
);
const canvas = document.getElementById("player");
const playButton = document.getElementById("play");
const slider = document.getElementById("frame");
const rate = document.getElementById("rate");
const camera = document.getElementById("camera");
let shown = 0;
let timer = null;

function draw() {
  const image = images[shown];
  if (canvas.width !== image.naturalWidth || canvas.height !== image.naturalHeight) {
    canvas.width = image.naturalWidth;
    canvas.height = image.naturalHeight;
  }
  canvas.getContext("2d").drawImage(image, 0, 0);
}

function showFrame(number) {
  links[shown].removeAttribute("aria-current");
  shown = (number + links.length) % links.length;
  links[shown].setAttribute("aria-current", "true");
  const name = links[shown].querySelector("h3").textContent;
  document.getElementById("frame-name").textContent = name;
  document.getElementById("frame-link").href = links[shown].href;
  canvas.setAttribute("aria-label", `Frame ${name}`);
  slider.value = shown;
  slider.setAttribute("aria-valuetext", name);
  draw();
}

function stop() {
  clearInterval(timer);
  timer = null;
  playButton.textContent = "Play";
}

function play() {
  clearInterval(timer);
  timer = setInterval(() => showFrame(shown + 1), 1000 / Number(rate.value));
  playButton.textContent = "Pause";
}

// Shows a frame, and stays at it.
function stay(number) {
  stop();
  showFrame(number);
}

async function showCamera(number) {
  images.forEach((image, frame) => {
    image.src = pictures[number][frame];
  });
  await decoded();
}

// A canvas can draw an image only when it is decoded. All frames are, so that none is late.
async function decoded() {
  await Promise.all(images.map((image) => image.decode()));
  showFrame(shown);
}

playButton.addEventListener("click", () => (timer === null ? play() : stop()));
document.getElementById("back").addEventListener("click", () => stay(shown - 1));
document.getElementById("forward").addEventListener("click", () => stay(shown + 1));
slider.addEventListener("input", () => stay(Number(slider.value)));
rate.addEventListener("input", () => {
  document.getElementById("rate-value").textContent = `${rate.value} / s`;
  if (timer !== null) play();
});
if (camera) {
  camera.addEventListener("change", () => showCamera(Number(camera.value)));
}
decoded();
