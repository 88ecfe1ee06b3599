// Geometries of the shapes that links look like.
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CylinderGeometry, LatheGeometry, SphereGeometry, Vector2,
} from "three";

const SIDES = 10; // of a roller
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

// Rings (radius, height) about z, closed at both ends.
function lathe({ rings }) {
  const points = [new Vector2(0, rings[1])];
  for (let i = 0; i < rings.length; i += 2) points.push(new Vector2(rings[i], rings[i + 1]));
  points.push(new Vector2(0, rings[rings.length - 1]));
  return new LatheGeometry(points, SIDES).rotateX(Math.PI / 2);
}

// The geometry of a shape in its own frame: cylinders and lathes about z, as physics has them.
export function geometryOf(shape) {
  const [x, y, z] = shape.size ?? [];
  switch (shape.kind) {
    case "box": return new BoxGeometry(2 * x, 2 * y, 2 * z);
    case "cylinder": return new CylinderGeometry(x, x, 2 * z, ROUND).rotateX(Math.PI / 2);
    case "lathe": return lathe(shape);
    case "hull": return hull(shape);
    default: return new SphereGeometry(1, 18, 12).scale(x, y, z); // sphere, ellipsoid
  }
}
