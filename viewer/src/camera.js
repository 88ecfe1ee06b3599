// The camera: presets, and following the robot.
import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

// Name -> direction from which the robot is seen (x ahead, y left, z up, in the robot's frame at the start) and whether
// the whole motion is to be seen, or the robot alone.
export const PRESETS = {
  whole: [[-0.75, -1, 0.85], true],
  above: [[-0.001, 0, 1], true],
  side: [[0, -1, 0.12], false],
  chase: [[-1, 0.25, 0.5], false],
  wheel: [[0.55, -1, 0.3], false],
};

export class Eye {
  constructor(canvas, across) {
    this.camera = new PerspectiveCamera(30, 1, 0.02, Math.max(300, 8 * across));
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { enableDamping: false, maxPolarAngle: 0.497 * Math.PI, minDistance: 0.15, maxDistance: Math.max(80, 4 * across) });
    this.follow = false;
  }

  // `subject`: {place, yaw, size} of the robot now, and {middle, extent} of the whole motion
  look(name, subject) {
    const [[x, y, z], whole] = PRESETS[name], turn = whole ? 0 : subject.yaw;
    this.name = name;
    this.follow = !whole;
    const target = whole ? subject.middle : subject.place.clone().setZ(subject.place.z + 0.25 * subject.size);
    const away = new Vector3(x * Math.cos(turn) - y * Math.sin(turn), x * Math.sin(turn) + y * Math.cos(turn), z).normalize();
    const narrow = Math.min(1, this.camera.aspect);
    const reach = whole ? subject.extent : subject.size * (name === "wheel" ? 1 : 1.5);
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(away, (0.92 * reach) / Math.tan((this.camera.fov * Math.PI) / 360) / narrow);
    this.last = subject.place.clone();
    this.controls.update();
  }

  track(place) {
    if (this.follow && this.last) {
      const step = place.clone().sub(this.last);
      this.controls.target.add(step);
      this.camera.position.add(step);
      this.controls.update();
    }
    this.last = place.clone();
  }
}
