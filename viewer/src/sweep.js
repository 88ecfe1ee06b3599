// The page of a sweep: filters, two heat maps, a table, and the case that is clicked.
import { Column, passing } from "./columns.js";
import { readData } from "./data.js";
import { HeatMap } from "./heatmap.js";
import { Table } from "./table.js";

const data = readData();
const byId = (id) => document.getElementById(id);
document.title = byId("title").textContent = data.title;
byId("about").textContent = data.about;
const columns = data.columns.map((column) => new Column(column, data.count));
const numbers = columns.filter((c) => c.axis || (!c.texts && !c.few) || (c.few && c.few.length > 1));

function filterOf(column) {
  const box = document.createElement("div");
  box.className = "filter";
  box.append(Object.assign(document.createElement("b"), { textContent: column.name }));
  if (column.few) {
    column.few.forEach((value) => {
      const button = Object.assign(document.createElement("button"), { textContent: column.text(value) });
      button.addEventListener("click", () => {
        const kept = new Set(column.kept);
        if (!kept.delete(value)) kept.add(value);
        column.kept = kept.size ? kept : undefined;
        refresh();
      });
      box.append(button);
    });
  } else {
    for (const end of ["low", "high"]) {
      const input = Object.assign(document.createElement("input"), { placeholder: end === "low" ? "from" : "to", size: 7 });
      input.dataset.end = end;
      input.addEventListener("change", () => {
        column[end] = input.value.trim() === "" || Number.isNaN(Number(input.value)) ? undefined : Number(input.value);
        refresh();
      });
      box.append(input);
    }
  }
  column.show = () => {
    box.querySelectorAll("button").forEach((b, k) => b.classList.toggle("on", Boolean(column.kept?.has(column.few[k]))));
    box.querySelectorAll("input").forEach((input) => { input.value = column[input.dataset.end] ?? ""; });
  };
  byId("filters").append(box);
}

const filtered = columns.filter((c) => c.filter !== false && (c.axis || (c.few ? c.few.length > 1 && c.few.length < 9 : !c.texts)));
filtered.forEach(filterOf);
const reset = Object.assign(document.createElement("button"), { textContent: "all cases" });
reset.addEventListener("click", () => { for (const c of columns) c.kept = c.low = c.high = undefined; refresh(); });
byId("filters").prepend(reset);

const axes = columns.filter((c) => c.axis && c.few && c.few.length > 1), place = (c) => numbers.indexOf(c);
const value = Math.max(0, numbers.findIndex((c) => c.name === data.value));
const at = (k) => place(axes[Math.min(k, axes.length - 1)]);
const maps = [[at(0), at(1), value], [at(2), at(3), value]].map((chosen) =>
  new HeatMap(byId("maps"), numbers, chosen.map((k) => Math.max(k, 0)), (column, filter) => {
    Object.assign(column, { kept: undefined, low: undefined, high: undefined }, filter);
    refresh();
  }));
const table = new Table(byId("rows"), columns.filter((c) => !c.texts || c.texts.length < data.count || c.name === "case"), openCase);

function openCase(i) {
  const lines = columns.map((c) => `<tr><td></td><td></td></tr>`).join("");
  const box = byId("case");
  box.hidden = false;
  box.innerHTML = `<button>close</button><h2></h2><p><code></code></p><table>${lines}</table>`;
  const name = columns.find((c) => c.name === "case");
  box.querySelector("h2").textContent = `case ${name ? name.text(name.values[i]) : i}`;
  box.querySelector("code").textContent = name ? `trajopt report ${data.store} ${name.text(name.values[i])}` : "";
  [...box.querySelectorAll("tr")].forEach((line, k) => {
    line.cells[0].textContent = columns[k].name;
    line.cells[1].textContent = columns[k].text(columns[k].values[i]);
  });
  box.querySelector("button").addEventListener("click", () => { box.hidden = true; });
}

function refresh() {
  const rows = passing(columns, data.count);
  byId("count").textContent = `${rows.length.toLocaleString("en")} of ${data.count.toLocaleString("en")} cases`;
  for (const column of filtered) column.show();
  for (const map of maps) map.draw(rows);
  table.show(rows);
}

refresh();
window.view = { data, columns, maps, table, refresh };
