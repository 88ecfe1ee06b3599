// One chart of step curves, with a linear or logarithmic axis across.
import { ticks } from "./plots.js";

const LEFT = 46, RIGHT = 10, TOP = 26, BOTTOM = 34;
const powers = (low, high) => {
  const found = [];
  for (let p = Math.ceil(Math.log10(low)); p <= Math.log10(high) + 1e-9; p++) found.push(10 ** p);
  return found;
};
const label = (v) => (v >= 1e4 || v < 1e-2 ? v.toExponential(0).replace("e+", "e") : String(v));

export class Chart {
  constructor(parent, data) {
    this.data = data;
    this.hidden = new Set();
    this.canvas = document.createElement("canvas");
    const box = document.createElement("figure");
    box.append(this.canvas);
    parent.append(box);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  draw() {
    const { clientWidth: w, clientHeight: h } = this.canvas, dots = window.devicePixelRatio || 1, { lines, log } = this.data;
    if (!w || !lines.length) return;
    [this.canvas.width, this.canvas.height] = [w * dots, h * dots];
    const pen = this.canvas.getContext("2d");
    pen.scale(dots, dots);
    const all = lines.flatMap(({ x }) => [x[0], x[x.length - 1]]).filter((v) => !log || v > 0);
    const [low, high] = [Math.min(...all), Math.max(...all)], of = log ? Math.log10 : (v) => v;
    const X = (v) => LEFT + ((of(v) - of(low)) / (of(high) - of(low) || 1)) * (w - LEFT - RIGHT);
    const Y = (v) => h - BOTTOM - v * (h - TOP - BOTTOM);
    pen.font = "600 12px system-ui, sans-serif";
    pen.fillStyle = "#1d2530";
    pen.fillText(this.data.title, LEFT, 15);
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = "#667080";
    pen.strokeStyle = "#e6e9ed";
    pen.textAlign = "right";
    for (const v of [0, 0.25, 0.5, 0.75, 1]) {
      pen.beginPath(); pen.moveTo(LEFT, Y(v)); pen.lineTo(w - RIGHT, Y(v)); pen.stroke();
      pen.fillText(String(v), LEFT - 6, Y(v) + 4);
    }
    pen.textAlign = "center";
    for (const v of log ? powers(low, high) : ticks(low, high, 5)) pen.fillText(label(v), X(v), h - BOTTOM + 14);
    pen.fillText(this.data.xlabel, (LEFT + w - RIGHT) / 2, h - 5);
    for (const line of [...lines].reverse()) if (!this.hidden.has(line.name)) this.steps(pen, line, X, Y);
  }

  steps(pen, { x, y, colour, dash }, X, Y) {
    Object.assign(pen, { strokeStyle: colour, lineWidth: 1.7 });
    pen.setLineDash(dash);
    pen.beginPath();
    for (let i = 0; i < x.length; i++) {
      if (i) pen.lineTo(X(x[i]), Y(y[i - 1]));
      pen.lineTo(X(x[i]), Y(y[i]));
    }
    pen.stroke();
    pen.setLineDash([]);
  }
}
