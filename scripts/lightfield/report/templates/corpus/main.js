// Shows the members of a corpus that match the search and the filters, a part of them at a time.

const { keys, members } = JSON.parse(document.getElementById("data").textContent);
const filters = document.getElementById("filters");
const cards = document.getElementById("cards");
const more = document.getElementById("more");
const count = document.getElementById("count");

// Members that are shown at once, and with each press of the button.
const STEP = 120;
let matching = [];
let shown = 0;

function element(name, content, properties = {}) {
  const created = Object.assign(document.createElement(name), properties);
  created.append(...content);
  return created;
}

// Return a drawn value as text. A number has six digits, without the last ones that computing leaves.
function shownValue(value) {
  return typeof value === "number" ? String(Number(value.toPrecision(6))) : (value ?? "–");
}

function card(member) {
  const parts = [];
  if (member.thumbnail) {
    parts.push(element("img", [], { src: member.thumbnail, loading: "lazy", alt: "" }));
  }
  const values = keys.map((key, index) => `${key.title} ${shownValue(member.values[index])}`);
  const badge = member.state === "valid" ? "badge good" : "badge bad";
  parts.push(
    element("div", [
      element("h3", [member.name]),
      element("p", [[member.source, ...values].join(", ")]),
      element("p", [`${member.split}, ${member.views} ${member.views === 1 ? "view" : "views"}`]),
      element("p", [element("span", [member.state], { className: badge })]),
    ]),
  );
  const link = element("a", parts, { href: member.state === "valid" ? member.link : "#failures" });
  return element("li", [link]);
}

function valueMatches(member, chosen, key, index) {
  const value = member.values[index];
  if (key.choices) {
    const choice = chosen.get(`value${index}`);
    return !choice || String(value) === choice;
  }
  const least = chosen.get(`least${index}`);
  const largest = chosen.get(`largest${index}`);
  if (least === "" && largest === "") return true;
  return (
    value !== null &&
    (least === "" || value >= Number(least)) &&
    (largest === "" || value <= Number(largest))
  );
}

// Every word of the search must stand in the member's name or source.
function matches(member, chosen, words) {
  const text = `${member.name} ${member.source}`.toLowerCase();
  return (
    words.every((word) => text.includes(word)) &&
    (!chosen.get("state") || member.state === chosen.get("state")) &&
    (!chosen.get("split") || member.split === chosen.get("split")) &&
    keys.every((key, index) => valueMatches(member, chosen, key, index))
  );
}

function showMore() {
  const next = matching.slice(shown, shown + STEP).map(card);
  cards.append(...next);
  shown += next.length;
  more.hidden = shown === matching.length;
  count.textContent = `${matching.length} of ${members.length} match`;
  return next;
}

function update() {
  const chosen = new FormData(filters);
  const words = chosen.get("search").toLowerCase().split(/\s+/).filter(Boolean);
  matching = members.filter((member) => matches(member, chosen, words));
  cards.replaceChildren();
  shown = 0;
  showMore();
}

filters.addEventListener("input", update);
filters.addEventListener("submit", (event) => event.preventDefault());
// The focus goes on to the first new member, because the button may disappear.
more.addEventListener("click", () => showMore()[0].querySelector("a").focus());
update();
