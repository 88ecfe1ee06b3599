// Mean of one column over two others.
import { select, shade } from "./columns.js";

const BINS = 12;

// Cells along a column: one for each of few values, else equal intervals.
function cells(column, rows) {
  if (column.few) {
    const place = new Map(column.few.map((v, k) => [v, k]));
    return { labels: column.few.map((v) => column.text(v)), of: (v) => place.get(v), pick: (k) => ({ kept: new Set([column.few[k]]) }) };
  }
  let [low, high] = [Infinity, -Infinity];
  for (const i of rows) { low = Math.min(low, column.values[i] || low); high = Math.max(high, column.values[i] || high); }
  const step = (high - low) / BINS || 1, edge = (k) => low + k * step;
  return {
    labels: Array.from({ length: BINS }, (_, k) => Number(edge(k + 0.5).toPrecision(3))),
    of: (v) => Math.min(BINS - 1, Math.floor((v - low) / step)),
    pick: (k) => ({ low: edge(k), high: edge(k + 1) }),
  };
}

export class HeatMap {
  // `chosen`: numbers of the columns x, y and value; `onPick(column, filter)` when a cell is clicked
  constructor(parent, columns, chosen, onPick) {
    Object.assign(this, { columns, chosen, onPick, rows: [] });
    this.element = document.createElement("figure");
    const bar = document.createElement("div");
    const names = columns.map((c) => c.name);
    ["across", "up", "mean of"].forEach((label, k) =>
      bar.append(select(label, names, chosen[k], (c) => { this.chosen[k] = c; this.draw(this.rows); })));
    this.grid = document.createElement("div");
    this.grid.className = "grid";
    this.element.append(bar, this.grid);
    parent.append(this.element);
  }

  draw(rows) {
    this.rows = rows;
    const [x, y, value] = this.chosen.map((k) => this.columns[k]);
    const [across, up] = [cells(x, rows), cells(y, rows)], [w, h] = [across.labels.length, up.labels.length];
    const sums = new Float64Array(w * h), counts = new Uint32Array(w * h);
    for (const i of rows) {
      const at = up.of(y.values[i]) * w + across.of(x.values[i]), v = value.values[i];
      if (at >= 0 && !Number.isNaN(v)) { sums[at] += v; counts[at] += 1; }
    }
    this.means = Array.from(sums, (s, k) => (counts[k] ? s / counts[k] : NaN));
    const known = this.means.filter((m) => !Number.isNaN(m));
    const [low, high] = [Math.min(...known), Math.max(...known)];
    this.grid.style.gridTemplateColumns = `auto repeat(${w}, minmax(30px, 1fr))`;
    this.grid.replaceChildren();
    const add = (text, name) => {
      const cell = document.createElement("div");
      Object.assign(cell, { textContent: text, className: name });
      this.grid.append(cell);
      return cell;
    };
    for (let r = h - 1; r >= 0; r--) {
      add(up.labels[r], "side");
      for (let c = 0; c < w; c++) {
        const mean = this.means[r * w + c], share = (mean - low) / (high - low || 1);
        const cell = add(Number.isNaN(mean) ? "" : String(Number(mean.toPrecision(3))), "cell");
        if (Number.isNaN(mean)) continue;
        Object.assign(cell.style, { background: shade(share), color: share > 0.6 ? "black" : "white" });
        cell.title = `${x.name} = ${across.labels[c]}, ${y.name} = ${up.labels[r]}: ${counts[r * w + c]} cases`;
        cell.addEventListener("click", () => { this.onPick(x, across.pick(c)); this.onPick(y, up.pick(r)); });
      }
    }
    add("", "side");
    for (const label of across.labels) add(label, "foot");
  }
}
