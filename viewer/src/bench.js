// The page of a comparison of optimizers: every curve and table of the report, one colour an optimizer.
import { Chart } from "./chart.js";
import { readData } from "./data.js";
import { render } from "./markdown.js";

const data = readData();
const byId = (id) => document.getElementById(id);
document.title = byId("title").textContent = data.title;
byId("about").textContent = data.about;
const charts = data.charts.map((chart) => new Chart(byId("charts"), chart));
const colours = new Map(data.charts.flatMap(({ lines }) => lines.map((line) => [line.name, line.colour])));

for (const [name, colour] of colours) {
  const button = document.createElement("button");
  button.className = "on";
  button.style.background = button.style.borderColor = colour;
  button.textContent = name;
  button.addEventListener("click", () => {
    const shown = button.classList.toggle("on");
    button.style.background = shown ? colour : "";
    for (const chart of charts) { chart.hidden[shown ? "delete" : "add"](name); chart.draw(); }
  });
  byId("filters").append(button);
}

for (const [title, lines] of Object.entries(data.sections)) {
  const before = byId("sections").childElementCount;
  const head = document.createElement("h2");
  head.textContent = title;
  byId("sections").append(head);
  render(byId("sections"), lines, colours);
  if (byId("sections").childElementCount === before + 1) head.remove(); // its pictures are charts above
}
window.view = { data, charts, colours: Object.fromEntries(colours) };
