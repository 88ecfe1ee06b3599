// Many rigid bodies as one geometry, drawn in one call: where the processor draws, each instance costs as much as a call.
import { BufferAttribute, BufferGeometry, DynamicDrawUsage } from "three";

export class Merged {
  // `parts`: geometry and colour of each body
  constructor(parts) {
    const sizes = parts.map(({ geometry }) => geometry.attributes.position.count);
    const total = sizes.reduce((sum, n) => sum + n, 0), faces = [];
    const colours = new Float32Array(3 * total);
    this.bodies = [];
    let first = 0;
    parts.forEach(({ geometry, colour }, k) => {
      const { position, normal } = geometry.attributes;
      this.bodies.push({ first, places: position.array, normals: normal.array });
      for (let i = 0; i < sizes[k]; i++) colour.toArray(colours, 3 * (first + i));
      const index = geometry.index?.array ?? Array.from({ length: sizes[k] }, (_, i) => i);
      for (const i of index) faces.push(first + i);
      first += sizes[k];
    });
    this.geometry = new BufferGeometry();
    for (const name of ["position", "normal"])
      this.geometry.setAttribute(name, new BufferAttribute(new Float32Array(3 * total), 3).setUsage(DynamicDrawUsage));
    this.geometry.setAttribute("color", new BufferAttribute(colours, 3));
    this.geometry.setIndex(faces);
  }

  // Puts body `k` where `m`, 16 numbers by columns, turns and moves it.
  place(k, m) {
    const { first, places, normals } = this.bodies[k], { position, normal } = this.geometry.attributes;
    const [a, b, c, , d, e, f, , g, h, i, , x, y, z] = m, to = position.array, out = normal.array;
    for (let n = 0, at = 3 * first; n < places.length; n += 3, at += 3) {
      const px = places[n], py = places[n + 1], pz = places[n + 2], nx = normals[n], ny = normals[n + 1], nz = normals[n + 2];
      to[at] = a * px + d * py + g * pz + x;
      to[at + 1] = b * px + e * py + h * pz + y;
      to[at + 2] = c * px + f * py + i * pz + z;
      out[at] = a * nx + d * ny + g * nz;
      out[at + 1] = b * nx + e * ny + h * nz;
      out[at + 2] = c * nx + f * ny + i * nz;
    }
  }

  update() {
    this.geometry.attributes.position.needsUpdate = this.geometry.attributes.normal.needsUpdate = true;
  }
}
