// Geometries of the shapes that links look like.
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CylinderGeometry, LatheGeometry, SphereGeometry, Vector2,
} from "three";

export const MANY = 300; // bodies from which on rollers are drawn with fewer faces
const ROUND = 28; // sides of a wheel

function hull({ corners, faces }) {
  const places = [];
  let middle = [0, 0, 0];
  for (let i = 0; i < corners.length; i++) middle[i % 3] += corners[i] / (corners.length / 3);
  for (const face of faces) {
    const [a, b, c] = face.map((k) => Array.from(corners.subarray(3 * k, 3 * k + 3)));
    const [u, v, out] = [b, c, a].map((p, k) => p.map((x, i) => x - (k < 2 ? a[i] : middle[i])));
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const outward = normal.reduce((sum, n, i) => sum + n * out[i], 0) > 0;
    places.push(...a, ...(outward ? b : c), ...(outward ? c : b));
  }
  const found = new BufferGeometry();
  found.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
  found.computeVertexNormals();
  return found;
}

// Rings (radius, height) about z, closed at both ends; of many only the first, the thickest and the last.
function lathe({ rings }, count) {
  const last = rings.length / 2 - 1, ring = (i) => new Vector2(rings[2 * i], rings[2 * i + 1]);
  if (count > MANY) {
    const points = [0, Math.round(last / 2), last].map(ring);
    return new LatheGeometry(points, 5).rotateX(Math.PI / 2);
  }
  const points = Array.from({ length: last + 1 }, (_, i) => ring(i));
  const [low, high] = [0, last].map((i) => new Vector2(0, rings[2 * i + 1]));
  return new LatheGeometry([low, ...points, high], 10).rotateX(Math.PI / 2);
}

// The geometry of a shape in its own frame: cylinders and lathes about z, as physics has them.
// `count`: how many bodies the robot has.
export function geometryOf(shape, count) {
  const [x, y, z] = shape.size ?? [];
  switch (shape.kind) {
    case "box": return new BoxGeometry(2 * x, 2 * y, 2 * z);
    case "cylinder": return new CylinderGeometry(x, x, 2 * z, ROUND).rotateX(Math.PI / 2);
    case "lathe": return lathe(shape, count);
    case "hull": return hull(shape);
    default: return new SphereGeometry(1, 18, 12).scale(x, y, z); // sphere, ellipsoid
  }
}
