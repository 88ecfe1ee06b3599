// The ground and what stands on it.
import {
  BufferAttribute, BufferGeometry, CanvasTexture, Color, DoubleSide, EdgesGeometry, ExtrudeGeometry, Group, LineBasicMaterial,
  LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, PlaneGeometry, RepeatWrapping, Shape, SRGBColorSpace, Vector2,
} from "three";

const BEYOND = 12; // m that level ground goes on around the motion
const THINGS = { step: "#b99b6b", wall: "#9aa3ad", circle: "#7d9a8c", polygon: "#8f8aa6" };

// Lines every 10 cm, and stronger ones every metre.
function grid(anisotropy) {
  const size = 512, canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d");
  pen.fillStyle = "#f1f3f5";
  pen.fillRect(0, 0, size, size);
  for (let k = 0; k <= 10; k++) {
    const strong = k % 10 === 0;
    pen.strokeStyle = strong ? "#9aa5b1" : "#dfe4e9";
    pen.lineWidth = strong ? 5 : 2;
    const at = (k * size) / 10;
    pen.beginPath();
    pen.moveTo(at, 0); pen.lineTo(at, size); pen.moveTo(0, at); pen.lineTo(size, at);
    pen.stroke();
  }
  const texture = new CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = anisotropy;
  return texture;
}

// Triangles through heights (M, K); cells are split from their lower left to their upper right corner.
function surface({ direction, along, across, heights }) {
  const [cos, sin] = [Math.cos(direction), Math.sin(direction)];
  const places = new Float32Array(3 * heights.length), marks = new Float32Array(2 * heights.length), faces = [];
  const K = across.length;
  for (let i = 0; i < along.length; i++) {
    for (let j = 0; j < K; j++) {
      const n = i * K + j, [x, y] = [along[i] * cos - across[j] * sin, along[i] * sin + across[j] * cos];
      places.set([x, y, heights[n]], 3 * n);
      marks.set([x, y], 2 * n);
      if (i + 1 < along.length && j + 1 < K) faces.push(n, n + K, n + K + 1, n, n + K + 1, n + 1);
    }
  }
  const found = new BufferGeometry();
  found.setAttribute("position", new BufferAttribute(places, 3));
  found.setAttribute("color", new BufferAttribute(tints(heights), 3));
  found.setAttribute("uv", new BufferAttribute(marks, 2));
  found.setIndex(faces);
  found.computeVertexNormals();
  return found;
}

// The higher, the browner.
function tints(heights) {
  const low = heights.reduce((a, b) => Math.min(a, b)), high = heights.reduce((a, b) => Math.max(a, b));
  const found = new Float32Array(3 * heights.length), [below, above] = [new Color("#ffffff"), new Color("#d9b98a")];
  heights.forEach((z, i) => below.clone().lerp(above, (z - low) / Math.max(high - low, 0.05)).toArray(found, 3 * i));
  return found;
}

function level({ low, high }) {
  const [w, h] = [high[0] - low[0] + 2 * BEYOND, high[1] - low[1] + 2 * BEYOND];
  const [x, y] = [Math.round((low[0] + high[0]) / 2), Math.round((low[1] + high[1]) / 2)];
  const found = new PlaneGeometry(w, h).translate(x, y, 0);
  const { position, uv } = found.attributes;
  for (let i = 0; i < position.count; i++) uv.setXY(i, position.getX(i), position.getY(i));
  return found;
}

function thing({ name, kind, outline, low, high }) {
  const shape = new Shape(outline.map(([x, y]) => new Vector2(x, y)));
  const body = new ExtrudeGeometry(shape, { depth: high - low, bevelEnabled: false }).translate(0, 0, low);
  const mesh = new Mesh(body, new MeshLambertMaterial({ color: THINGS[kind] ?? "#9a9a9a" }));
  mesh.name = name;
  mesh.castShadow = mesh.receiveShadow = true;
  if (kind !== "step") Object.assign(mesh.material, { transparent: true, opacity: 0.8 });
  mesh.add(new LineSegments(new EdgesGeometry(body, 30), new LineBasicMaterial({ color: "#3d3427" })));
  return mesh;
}

// `fine`: with shadows, and textures sharp at a slant.
export function sceneOf(data, fine) {
  const group = new Group();
  const geometry = data.ground ? surface(data.ground) : level(data);
  const Material = fine || data.ground ? MeshLambertMaterial : MeshBasicMaterial;
  const material = new Material({ map: grid(fine ? 8 : 1), side: DoubleSide, vertexColors: Boolean(data.ground) });
  const ground = new Mesh(geometry, material);
  ground.name = "ground";
  ground.receiveShadow = true;
  const things = data.things.map(thing);
  group.add(ground, ...things);
  return { group, ground, things };
}
