// The page of a run: the robot in its scene, played over time, with plots under one cursor.
import {
  Color, DirectionalLight, Fog, HemisphereLight, PCFShadowMap, Raycaster, Scene, Vector3, WebGLRenderer,
} from "three";
import { Forces, hitMarks, LOAD, ribbon, SLIP } from "./arrows.js";
import { Eye, PRESETS } from "./camera.js";
import { COLOURS, readData } from "./data.js";
import { Plot } from "./plots.js";
import { Model, Robot } from "./robot.js";
import { sceneOf } from "./scene.js";
import { Player } from "./player.js";

// Whether pictures are drawn by the processor.
function inSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const facts = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = facts ? gl.getParameter(facts.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

const SLOW = 24; // frames a second below which shadows are given up
const data = readData();
const byId = (id) => document.getElementById(id);
document.title = data.title;
byId("title").textContent = data.title;
byId("about").textContent = data.about;

const fine = location.hash === "#fine" || !inSoftware(); // no edges smoothed and no shadows where no graphics card helps
const renderer = new WebGLRenderer({ antialias: fine, preserveDrawingBuffer: true });
renderer.shadowMap.enabled = fine;
renderer.shadowMap.type = PCFShadowMap;
byId("stage").prepend(renderer.domElement);
const scene = new Scene();
scene.background = new Color("#e9eef3");
scene.fog = new Fog("#e9eef3", 14, 40); // put behind what is to be seen by haze()
const sun = new DirectionalLight("#fff6e8", 2.2);
scene.add(new HemisphereLight("#ffffff", "#b9c0c8", 2.0), sun, sun.target);

const surroundings = sceneOf(data.scene, fine);
scene.add(surroundings.group);
const model = new Model(data.robot);
const solid = data.motions.length - 1; // the last motion is the subject, earlier ones are hinted at
const robots = data.motions.map((motion, k) => new Robot(model, motion, k === solid ? null : COLOURS[k % COLOURS.length]));
const forces = robots.map((robot) => new Forces(robot));
const across = Math.hypot(data.scene.high[0] - data.scene.low[0], data.scene.high[1] - data.scene.low[1]);
const wide = Math.max(0.02 * model.size, 0.0022 * across);
const paths = data.motions.map((motion, k) =>
  ribbon(motion.base, motion.ground, k === solid ? wide : 2.2 * wide, (data.scene.ground ? 0.012 : 0.004) + 0.002 * k, COLOURS[k % COLOURS.length]));
const marks = hitMarks(data.hits, model.size, 0);
robots.forEach((robot, k) => scene.add(robot.group, paths[k], forces[k].group));
if (marks.length) scene.add(...marks);

const duration = Math.max(...data.motions.map((motion) => motion.times[motion.times.length - 1]));
const eye = new Eye(renderer.domElement, across);

function subject() {
  const robot = robots[solid], low = new Vector3(Infinity, Infinity, Infinity), high = low.clone().negate();
  for (const { base } of data.motions)
    for (let i = 0; i < base.length; i += 7) {
      const p = new Vector3(base[i], base[i + 1], base[i + 2]);
      low.min(p); high.max(p);
    }
  const ahead = new Vector3(1, 0, 0).transformDirection(robot.world[0]);
  const extent = Math.max(0.5 * low.distanceTo(high) + model.size, 1.2 * model.size);
  return { place: robot.place(), yaw: Math.atan2(ahead.y, ahead.x), size: model.size, extent, middle: low.add(high).multiplyScalar(0.5) };
}

function light() {
  const at = robots[solid].place(), reach = 2.2 * model.size;
  sun.target.position.copy(at);
  sun.position.copy(at).add(new Vector3(-1.2, -1.6, 3.2).multiplyScalar(3 * model.size));
  Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1, far: 20 * model.size });
  sun.shadow.camera.updateProjectionMatrix();
}
sun.castShadow = fine;
sun.shadow.mapSize.set(1024, 1024);
sun.shadow.bias = -0.0008;

function haze() {
  const away = eye.camera.position.distanceTo(eye.controls.target) + 0.6 * across;
  Object.assign(scene.fog, { near: Math.max(14, away), far: Math.max(40, 2.2 * away) });
}

function show(time) {
  robots.forEach((robot, k) => {
    robot.pose(time);
    if (forces[k].group.visible) forces[k].pose(time);
  });
  for (const mark of marks) mark.visible = time >= mark.userData.time;
  eye.track(robots[solid].place());
  light();
  haze();
  renderer.render(scene, eye.camera);
  for (const plot of plots) plot.show(time);
}

const plots = data.plots.map((plot) => new Plot(byId("plots"), plot, duration, (t) => player.set(t)));
if (!plots.length) document.querySelector("main").classList.add("bare");
const player = new Player(duration, show);

function resize() {
  const { clientWidth: w, clientHeight: h } = byId("stage");
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
  renderer.setSize(w, h, false);
  eye.camera.aspect = w / h;
  eye.camera.updateProjectionMatrix();
  player.dirty = true;
}
new ResizeObserver(resize).observe(byId("stage"));
eye.controls.addEventListener("change", () => { player.dirty = true; });

function layer(name, colour, objects, key) {
  const label = document.createElement("label");
  label.innerHTML = `<input type="checkbox" checked><i></i><span></span>`;
  const [box, swatch, text] = label.children;
  swatch.style.background = colour;
  text.textContent = name;
  box.addEventListener("change", () => {
    for (const object of objects) object.visible = box.checked;
    player.dirty = true;
  });
  byId("layers").append(label);
  if (key) player.keys[key] = [`show or hide ${name}`, () => box.click()];
}

robots.forEach((robot, k) => layer(robot.motion.name, COLOURS[k % COLOURS.length], [robot.group, paths[k]], String.fromCharCode(97 + k)));
if (forces.some((f) => f.loads)) layer("loads", LOAD, forces.flatMap((f) => (f.loads ? [f.loads.shaft, f.loads.head] : [])), "l");
if (forces.some((f) => f.slips)) layer("slip", SLIP, forces.flatMap((f) => (f.slips ? [f.slips.shaft, f.slips.head] : [])), "s");
let apart = false;
if (robots.length > 1) {
  player.keys.x = ["robots apart, or in one place", () => {
    apart = !apart;
    robots.forEach((robot, k) => [robot.group, paths[k], forces[k].group].forEach((o) => o.position.set(0, apart ? 2.4 * model.size * (solid - k) : 0, 0)));
    player.dirty = true;
  }];
}
Object.keys(PRESETS).forEach((name, k) => {
  const button = document.createElement("button");
  button.textContent = name;
  const press = () => {
    eye.look(name, subject());
    for (const other of byId("cameras").children) other.classList.toggle("on", other === button);
    player.dirty = true;
  };
  button.addEventListener("click", press);
  byId("cameras").append(button);
  player.keys[String(k + 1)] = [`camera: ${name}`, press];
});

resize();
robots.forEach((robot) => robot.pose(0));
byId("cameras").firstChild.click();
player.onSlow = () => {
  if (!sun.castShadow) return;
  sun.castShadow = false;
  robots[solid].mesh.material.needsUpdate = true;
};
player.slowest = SLOW;
player.start();

// What tests and recorders use.
window.view = {
  data, duration, player,
  opened: performance.now() / 1000, // s from the start of loading until all was built
  frame: (time) => { player.set(time); player.draw(); },
  look: (name) => Array.from(byId("cameras").children).find((button) => button.textContent === name).click(),
  // of a link by name, read from the scene
  angle: (motion, name) => robots[motion].angleOf(model.data.names.indexOf(name)),
  // of the robot's frame, or of a link by name
  place: (motion, name) => robots[motion].place(name ? model.data.names.indexOf(name) : 0).toArray(),
  yaw: (motion) => { const e = robots[motion].world[0].elements; return Math.atan2(e[1], e[0]); },
  corners: (name) => {
    const { geometry } = surroundings.things.find((mesh) => mesh.name === name);
    geometry.computeBoundingBox();
    return [geometry.boundingBox.min.toArray(), geometry.boundingBox.max.toArray()];
  },
  height: (x, y) => {
    const ray = new Raycaster(new Vector3(x, y, 100), new Vector3(0, 0, -1));
    return ray.intersectObject(surroundings.ground)[0]?.point.z ?? null;
  },
  bodies: model.count,
  // the stage without anything around it
  alone: () => { document.querySelector("main").classList.add("alone"); resize(); },
};
