// Shows the datasets that match the search and the filters.

const controls = document.getElementById("filters");
const cards = [...document.querySelectorAll(".datasets li")];
const count = document.getElementById("count");

// Every word of the search must stand in the dataset's scene, rig or lens.
function matches(card, words, lens, state) {
  const text = card.dataset.text.toLowerCase();
  return (
    words.every((word) => text.includes(word)) &&
    (!lens || card.dataset.lens === lens) &&
    (!state || card.dataset.state === state)
  );
}

function update() {
  const chosen = new FormData(controls);
  const words = chosen.get("search").toLowerCase().split(/\s+/).filter(Boolean);
  for (const card of cards) {
    card.hidden = !matches(card, words, chosen.get("lens"), chosen.get("state"));
  }
  const shown = cards.filter((card) => !card.hidden).length;
  count.textContent = `${shown} of ${cards.length} shown`;
}

if (controls) {
  controls.addEventListener("input", update);
  controls.addEventListener("submit", (event) => event.preventDefault());
  update();
}
