// Loads and slip of wheels as arrows, paths as ribbons, and marks where an obstacle was touched.
import {
  BufferAttribute, BufferGeometry, ConeGeometry, CylinderGeometry, DoubleSide, Group, InstancedMesh, Matrix4, Mesh,
  MeshBasicMaterial, Quaternion, SphereGeometry, Vector3,
} from "three";
import { between, locate } from "./data.js";

const UP = new Vector3(0, 1, 0);
const EVEN = 0.35; // length of the arrow of a load that all wheels have alike, over the robot's size
const FULL_SLIP = 0.1; // m/s that an arrow as long as the robot stands for
export const LOAD = "#0072B2", SLIP = "#D55E00";

// Arrows of unit length along y, drawn together.
class Arrows {
  constructor(count, colour, thick) {
    const material = new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true, opacity: 0.9 }); // seen through chassis
    this.shaft = new InstancedMesh(new CylinderGeometry(thick, thick, 1, 10).translate(0, 0.5, 0), material, count);
    this.head = new InstancedMesh(new ConeGeometry(2.6 * thick, 6 * thick, 12).translate(0, 3 * thick, 0), material, count);
    this.shaft.frustumCulled = this.head.frustumCulled = false;
    this.shaft.renderOrder = this.head.renderOrder = 1;
    this.thick = thick;
  }

  set(k, from, vector) {
    const length = vector.length(), shown = length > 1e-4;
    const turn = new Quaternion().setFromUnitVectors(UP, shown ? vector.clone().divideScalar(length) : UP);
    const size = shown ? Math.min(1, length / (9 * this.thick)) : 0; // short arrows have small heads
    this.shaft.setMatrixAt(k, new Matrix4().compose(from, turn, new Vector3(size, length, size)));
    this.head.setMatrixAt(k, new Matrix4().compose(from.clone().add(vector), turn, new Vector3(size, size, size)));
    this.shaft.instanceMatrix.needsUpdate = this.head.instanceMatrix.needsUpdate = true;
  }
}

// The forces on one robot's wheels.
export class Forces {
  constructor(robot) {
    this.robot = robot;
    this.group = new Group();
    const { feet } = robot.model.data, thick = 0.012 * robot.model.size;
    this.loads = robot.motion.loads && new Arrows(feet.length, LOAD, thick);
    this.slips = robot.motion.slip && new Arrows(feet.length, SLIP, thick);
    for (const arrows of [this.loads, this.slips]) if (arrows) this.group.add(arrows.shaft, arrows.head);
  }

  pose(time) {
    const { feet, radii, mass } = this.robot.model.data, { motion, model } = this.robot;
    const at = locate(motion.times, time), turn = new Quaternion().setFromRotationMatrix(this.robot.world[0]);
    feet.forEach((foot, k) => {
      const low = this.robot.place(foot);
      low.z -= radii[k];
      if (this.loads) {
        const share = (between(motion.loads, at, feet.length, k) * feet.length) / (9.81 * mass);
        this.loads.set(k, low, new Vector3(0, 0, EVEN * share * model.size));
      }
      if (this.slips) {
        const [x, y] = [0, 1].map((c) => between(motion.slip, at, 2 * feet.length, 2 * k + c));
        const scale = Math.min(model.size / FULL_SLIP, model.size / (Math.hypot(x, y) + 1e-9));
        low.z += 0.01;
        this.slips.set(k, low, new Vector3(x, y, 0).multiplyScalar(scale).applyQuaternion(turn));
      }
    });
  }
}

// A flat band along the way of a robot's origin, at the heights (N,) of what is below it.
export function ribbon(base, heights, width, lift, colour) {
  const n = base.length / 7, places = new Float32Array(6 * n), faces = [];
  const at = (i) => new Vector3(base[7 * i], base[7 * i + 1], base[7 * i + 2]);
  let across = new Vector3(0, 1, 0);
  for (let i = 0; i < n; i++) {
    const ahead = at(Math.min(i + 1, n - 1)).sub(at(Math.max(i - 1, 0)));
    if (Math.hypot(ahead.x, ahead.y) > 1e-5) across = new Vector3(-ahead.y, ahead.x, 0).normalize();
    const p = at(i);
    for (const [k, side] of [-0.5, 0.5].entries())
      places.set([p.x + side * width * across.x, p.y + side * width * across.y, heights[i] + lift], 6 * i + 3 * k);
    if (i + 1 < n) faces.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2);
  }
  const found = new BufferGeometry();
  found.setAttribute("position", new BufferAttribute(places, 3));
  found.setIndex(faces);
  return new Mesh(found, new MeshBasicMaterial({ color: colour, side: DoubleSide, transparent: true, opacity: 0.85 }));
}

// Where something was touched: shown from then on.
export function hitMarks(hits, size, ground) {
  return hits.map((hit) => {
    const mark = new Mesh(new SphereGeometry(0.05 * size, 16, 12), new MeshBasicMaterial({ color: SLIP }));
    mark.position.set(hit.place_m[0], hit.place_m[1], ground + 0.05 * size);
    mark.userData.time = hit.time_s;
    return mark;
  });
}
