// Time: play, speed, scrub, keys. Draws only when something has changed.
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const byId = (id) => document.getElementById(id);

export class Player {
  constructor(duration, show) {
    Object.assign(this, { duration, show, time: 0, playing: false, speed: 1, dirty: true, frames: 0, fps: 0 });
    this.keys = {
      " ": ["play or pause", () => this.toggle()],
      ArrowLeft: ["back by 1 %", () => this.set(this.time - duration / 100)],
      ArrowRight: ["on by 1 %", () => this.set(this.time + duration / 100)],
      Home: ["to the start", () => this.set(0)],
      End: ["to the end", () => this.set(duration)],
      "[": ["slower", () => this.faster(-1)],
      "]": ["faster", () => this.faster(1)],
      "?": ["these keys", () => this.help()],
    };
    byId("time").max = duration;
    byId("time").addEventListener("input", (event) => this.set(Number(event.target.value)));
    byId("play").addEventListener("click", () => this.toggle());
    byId("help").addEventListener("click", () => this.help());
    for (const speed of SPEEDS) byId("speed").add(new Option(`${speed} ×`, speed, speed === 1, speed === 1));
    byId("speed").addEventListener("change", (event) => { this.speed = Number(event.target.value); });
    document.addEventListener("keydown", (event) => this.press(event));
  }

  press(event) {
    const bound = this.keys[event.key];
    if (!bound || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.matches?.("select, input[type=checkbox]") && event.key.startsWith("Arrow")) return;
    event.preventDefault();
    bound[1]();
  }

  help() {
    const box = byId("keys");
    if (box.open) return box.close();
    const name = { " ": "space", ArrowLeft: "←", ArrowRight: "→" };
    box.innerHTML = "<table>" + Object.entries(this.keys).map(([key, [what]]) =>
      `<tr><td><kbd>${name[key] ?? key}</kbd></td><td>${what}</td></tr>`).join("") + "</table>";
    box.onclick = () => box.close();
    box.showModal();
  }

  faster(steps) {
    const at = SPEEDS.indexOf(this.speed) + steps;
    this.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, at))];
    byId("speed").value = this.speed;
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing && this.time >= this.duration) this.time = 0;
    byId("play").textContent = this.playing ? "⏸" : "▶";
    this.before = undefined;
    this.frames = 0;
  }

  set(time) {
    this.time = Math.min(this.duration, Math.max(0, time));
    this.dirty = true;
  }

  draw() {
    this.dirty = false;
    byId("time").value = this.time;
    byId("clock").textContent = `${this.time.toFixed(2)} / ${this.duration.toFixed(2)} s`;
    this.show(this.time);
  }

  // Frames a second over the last dozen; tells when they are too few.
  count(now) {
    if (this.frames++ === 0) this.since = now;
    if (this.frames === 13) {
      this.fps = 12000 / (now - this.since);
      this.frames = 0;
      if (this.fps < this.slowest) this.onSlow?.();
    }
  }

  start() {
    const step = (now) => {
      if (this.playing) {
        this.count(now);
        if (this.before !== undefined) this.set(this.time + ((now - this.before) / 1000) * this.speed);
        this.before = now;
        if (this.time >= this.duration) this.toggle();
      }
      if (this.dirty) this.draw();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
}
