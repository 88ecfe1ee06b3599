// Curves over time that share one cursor.
import { between, COLOURS, locate } from "./data.js";

const LEFT = 44, RIGHT = 6, TOP = 6, BOTTOM = 18;
const number = (v) => (Math.abs(v) >= 1e4 || (v && Math.abs(v) < 1e-3) ? v.toExponential(1) : String(+v.toPrecision(4)));

// Round values in [low, high], about `count` of them.
export function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
  const found = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(Math.abs(v) < step / 1e6 ? 0 : v);
  return found;
}

export class Plot {
  constructor(parent, { title, unit, lines, mark }, duration, onTime) {
    Object.assign(this, { lines, mark, duration });
    this.element = document.createElement("div");
    this.element.className = "plot";
    this.element.innerHTML = `<h2></h2><canvas></canvas><div class="cursor"></div><div class="legend"></div>`;
    this.element.firstChild.textContent = `${title} (${unit})`;
    [, this.canvas, this.cursor, this.legend] = this.element.children;
    parent.append(this.element);
    this.values = lines.map((line) => {
      if (line.dashed) return null; // its name is that of the full line
      const entry = document.createElement("span");
      entry.innerHTML = `<i></i><span></span> <b></b>`;
      entry.children[0].style.borderColor = this.colour(line);
      entry.children[0].classList.toggle("dashed", line.dashed);
      entry.children[1].textContent = line.name;
      this.legend.append(entry);
      return entry.children[2];
    });
    if (lines.some((line) => line.dashed)) this.legend.append("dotted: simulated");
    this.range();
    const move = (event) => onTime(this.timeAt(event));
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); move(event); });
    this.canvas.addEventListener("pointermove", (event) => event.buttons && move(event));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  colour(line) { return COLOURS[line.colour % COLOURS.length]; }

  range() {
    let [low, high] = [Infinity, -Infinity];
    for (const { y } of this.lines) for (const v of y) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (this.mark !== undefined) { low = Math.min(low, 0); high = Math.max(high, 1.08 * this.mark); }
    if (!(high > low)) { low -= 0.5; high += 0.5; }
    const room = 0.06 * (high - low);
    [this.low, this.high] = [low === 0 ? 0 : low - room, high + room];
  }

  timeAt(event) {
    const box = this.canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    return Math.min(1, Math.max(0, share)) * this.duration;
  }

  draw() {
    const { clientWidth: w, clientHeight: h } = this.canvas, dots = window.devicePixelRatio || 1;
    if (!w) return;
    [this.canvas.width, this.canvas.height] = [w * dots, h * dots];
    const pen = this.canvas.getContext("2d");
    pen.scale(dots, dots);
    const x = (t) => LEFT + (t / this.duration) * (w - LEFT - RIGHT);
    const y = (v) => h - BOTTOM - ((v - this.low) / (this.high - this.low)) * (h - TOP - BOTTOM);
    pen.font = "10.5px system-ui, sans-serif";
    pen.fillStyle = "#667080";
    pen.strokeStyle = "#e6e9ed";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const v of ticks(this.low, this.high, 4)) {
      pen.beginPath(); pen.moveTo(LEFT, y(v)); pen.lineTo(w - RIGHT, y(v)); pen.stroke();
      pen.fillText(number(v), LEFT - 5, y(v));
    }
    pen.textAlign = "center";
    pen.textBaseline = "alphabetic";
    for (const t of ticks(0, this.duration, 5)) pen.fillText(`${number(t)} s`, Math.min(x(t), w - 14), h - 4);
    if (this.mark !== undefined) this.stroke(pen, [[LEFT, y(this.mark)], [w - RIGHT, y(this.mark)]], "#667080", [4, 3], 1);
    for (const line of [...this.lines].reverse()) {
      const points = Array.from(line.x, (t, i) => [x(t), y(line.y[i])]).filter((p) => Number.isFinite(p[1]));
      this.stroke(pen, points, this.colour(line), line.dashed ? [2, 3] : [], 1.6);
    }
    this.show(this.time ?? 0);
  }

  stroke(pen, points, colour, dash, width) {
    Object.assign(pen, { strokeStyle: colour, lineWidth: width, lineJoin: "round" });
    pen.setLineDash(dash);
    pen.beginPath();
    points.forEach(([a, b], i) => (i ? pen.lineTo(a, b) : pen.moveTo(a, b)));
    pen.stroke();
    pen.setLineDash([]);
  }

  show(time) {
    this.time = time;
    const { clientWidth: w, clientHeight: h, offsetLeft, offsetTop } = this.canvas;
    const left = offsetLeft + LEFT + (time / this.duration) * (w - LEFT - RIGHT);
    Object.assign(this.cursor.style, { left: `${left}px`, top: `${offsetTop + TOP}px`, height: `${h - TOP - BOTTOM}px` });
    this.lines.forEach((line, k) => { if (this.values[k]) this.values[k].textContent = this.rounded(between(line.y, locate(line.x, time))); });
  }

  // Nothing that is far below what the axis shows.
  rounded(value) {
    return number(Math.abs(value) < 1e-5 * (this.high - this.low) ? 0 : value);
  }
}
