// A robot as a tree of links: places them for joint angles, draws them together.
import {
  Color, Group, LineBasicMaterial, LineSegments, EdgesGeometry, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  Quaternion, Shape, ShapeGeometry, SRGBColorSpace, Vector2, Vector3,
} from "three";
import { between, locate } from "./data.js";
import { Merged } from "./merged.js";
import { geometryOf, MANY } from "./shapes.js";

const MARK = new Color("#e8e8e4"); // of what shows how a wheel has turned
const ROD = new Color("#5c6670"); // of what holds wheels
const ONE = new Vector3(1, 1, 1);
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4 }; // where both are, the solid one shows

function poseMatrix(row, i) {
  const at = row.subarray(7 * i, 7 * i + 7);
  return new Matrix4().compose(new Vector3(at[0], at[1], at[2]), new Quaternion(at[3], at[4], at[5], at[6]), ONE);
}

// What all robots on the page share: joints at rest, and geometries.
export class Model {
  constructor(data) {
    this.data = data;
    this.count = data.parents.length;
    this.rest = data.parents.map((_, i) => poseMatrix(data.rest, i));
    this.axes = data.parents.map((_, i) => new Vector3(...data.axes.subarray(3 * i, 3 * i + 3)));
    this.geometries = data.shapes.map((shape) => geometryOf(shape, this.count));
    this.looks = data.looks.map(([link, shape, order], i) => ({
      link, shape, pose: poseMatrix(data.poses, i), colour: this.colourOf(i, order),
    }));
    const reach = data.footprint.map(([x, y]) => Math.hypot(x, y));
    this.size = Math.max(...reach, ...this.rest.map((m) => Math.hypot(m.elements[12], m.elements[13])));
  }

  colourOf(i, order) {
    const [link] = this.data.looks[i];
    const colour = new Color().setRGB(...this.data.colours.subarray(3 * i, 3 * i + 3), SRGBColorSpace);
    if (order > 0) return link === 0 ? ROD : this.data.roles[link] === "spin" ? MARK : colour;
    return ["steer", "swivel", "tilt"].includes(this.data.roles[link]) ? ROD : colour;
  }
}

export class Robot {
  // `tint`: colour of a robot that is only hinted at; null for a solid one
  constructor(model, motion, tint) {
    this.model = model;
    this.motion = motion;
    this.group = new Group();
    this.world = model.rest.map(() => new Matrix4());
    this.turn = new Matrix4();
    this.joints = Object.entries(motion.joints).map(([link, angles]) => [Number(link), angles]);
    this.angles = new Float32Array(model.count);
    this.rollers = motion.rollers.map(accumulated);
    this.build(tint);
  }

  build(tint) {
    const { looks, geometries } = this.model;
    const material = new MeshLambertMaterial({ vertexColors: true });
    if (tint) Object.assign(material, { transparent: true, opacity: 0.34, depthWrite: false, ...BEHIND });
    // Of a robot that is only hinted at, rollers are left out where they are many.
    const bare = tint && this.model.count > MANY;
    this.looks = looks.filter(({ link }) => !bare || this.model.data.roles[link] !== "roller");
    this.merged = new Merged(this.looks.map(({ shape, colour }) => ({
      geometry: geometries[shape], colour: tint ? colour.clone().lerp(new Color(tint), 0.75) : colour,
    })));
    this.mesh = new Mesh(this.merged.geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.castShadow = !tint;
    this.group.add(this.mesh);
    this.addNose(tint);
    this.edges = looks.filter((look) => look.link === 0).slice(0, 1).map((look) => {
      const lines = new LineSegments(
        new EdgesGeometry(geometries[look.shape], 25),
        new LineBasicMaterial({ color: tint ?? "#10151c", transparent: true, opacity: tint ? 0.8 : 0.45 }),
      );
      lines.matrixAutoUpdate = false;
      this.group.add(lines);
      return { lines, look };
    });
  }

  // A mark on top of the chassis that points ahead.
  addNose(tint) {
    const look = this.model.looks.find(({ link }) => link === 0), [x, y, z] = this.model.data.shapes[look.shape].size;
    const shape = new Shape([new Vector2(0.88 * x, 0), new Vector2(0.5 * x, 0.38 * y), new Vector2(0.5 * x, -0.38 * y)]);
    const material = new MeshBasicMaterial({ color: tint ?? "#f3c84b", transparent: Boolean(tint), opacity: tint ? 0.5 : 1, ...(tint ? BEHIND : {}) });
    this.nose = { mesh: new Mesh(new ShapeGeometry(shape).translate(0, 0, 1.004 * z + 0.001), material), look };
    this.nose.mesh.matrixAutoUpdate = false;
    this.group.add(this.nose.mesh);
  }

  // Places everything as at `time` (s).
  pose(time) {
    const { model, motion, world, angles, turn } = this;
    const at = locate(motion.times, time);
    const base = Array.from({ length: 7 }, (_, k) => between(motion.base, at, 7, k));
    const attitude = new Quaternion(base[3], base[4], base[5], base[6]).normalize();
    world[0].compose(new Vector3(base[0], base[1], base[2]), attitude, ONE);
    for (const [link, values] of this.joints) angles[link] = between(values, at);
    for (const { first, count, turned } of this.rollers)
      for (let k = 0; k < count; k++) angles[first + k] = between(turned, at, count, k);
    for (let i = 1; i < model.count; i++) {
      world[i].multiplyMatrices(world[model.data.parents[i]], model.rest[i]);
      if (!angles[i]) continue;
      const axis = model.axes[i];
      if (model.data.roles[i] === "spring") turn.makeTranslation(axis.clone().multiplyScalar(angles[i]));
      else turn.makeRotationAxis(axis, angles[i]);
      world[i].multiply(turn);
    }
    const placed = new Matrix4();
    this.looks.forEach((look, k) => this.merged.place(k, placed.multiplyMatrices(world[look.link], look.pose).elements));
    this.merged.update();
    this.nose.mesh.matrix.multiplyMatrices(world[0], this.nose.look.pose);
    for (const { lines, look } of this.edges) lines.matrix.multiplyMatrices(world[look.link], look.pose);
  }

  place(link = 0) {
    return new Vector3().setFromMatrixPosition(this.world[link]);
  }

  // Angle (rad, within half a turn) by which a link stands turned about its joint's axis, read from where it is drawn.
  angleOf(link) {
    const { model, world } = this;
    const rest = new Matrix4().multiplyMatrices(world[model.data.parents[link]], model.rest[link]);
    const turn = new Quaternion().setFromRotationMatrix(rest.invert().multiply(world[link]));
    const along = new Vector3(turn.x, turn.y, turn.z).dot(model.axes[link]);
    return 2 * Math.atan2(along * Math.sign(turn.w || 1), Math.abs(turn.w));
  }
}

// Angles of all rollers of a wheel at every sample, from which one is lowest and by how much it turns.
function accumulated({ first, count, lowest, turned }) {
  const all = new Float32Array(count * lowest.length);
  for (let i = 1; i < lowest.length; i++) {
    all.copyWithin(i * count, (i - 1) * count, i * count);
    all[i * count + lowest[i - 1]] += turned[i - 1];
  }
  return { first, count, turned: all };
}
