// Where somebody in a headset stands in the scene. The scene has its own unit and up; a headset has metres, x to the right,
// y up and z backward, with the floor at y = 0.

const RESIZED = 20; // times smaller or larger than it was made, at most

class Stage {
  /** header: up and stage, as in docs/player_format.md; levelAxes: two directions that lie level, as of View. */
  constructor(header, levelAxes) {
    this.up = header.up;
    this.levelAxes = levelAxes;
    const { floor, meters_per_unit } = header.stage;
    this.floor = floor;
    this.metersPerUnit = this.madeMeters = meters_per_unit;
    this.yaw = 0; // of the headset's forward axis, as of View
    this.origin = scaled(this.up, floor); // what lies under the headset's origin
  }

  /** Directions of the headset's axes in the scene. */
  axes() {
    const [e0, e1] = this.levelAxes;
    const forward = sum(scaled(e0, Math.cos(this.yaw)), e1, Math.sin(this.yaw));
    return [cross(forward, this.up), this.up, scaled(forward, -1)];
  }

  /** A level way in the scene, of one in metres. */
  way([x, , z]) {
    const [right, , backward] = this.axes();
    return scaled(sum(scaled(right, x), backward, z), 1 / this.metersPerUnit);
  }

  /** Stand on the ground below a camera, and face as it does. head: place and forward direction, m. */
  enter(worldToCamera, head, forward) {
    const [right, down, ahead] = [0, 4, 8].map((at) => worldToCamera.slice(at, at + 3));
    const eye = scaled(sum(sum(scaled(right, worldToCamera[3]), down, worldToCamera[7]), ahead, worldToCamera[11]), -1);
    const [e0, e1] = this.levelAxes;
    this.yaw = Math.atan2(dot(ahead, e1), dot(ahead, e0)) - Math.atan2(-forward[0], -forward[2]);
    const below = sum(eye, this.up, this.floor - dot(this.up, eye));
    this.origin = sum(below, this.way(head), -1);
  }

  /** Turn to the left on the spot. radians; head: m */
  turn(angle, head) {
    const here = sum(this.origin, this.way(head));
    this.yaw += angle;
    this.origin = sum(here, this.way(head), -1);
  }

  /** Become so many times larger around where one stands. head: m */
  resize(factor, head) {
    const here = sum(this.origin, this.way(head)), { madeMeters } = this;
    this.metersPerUnit = Math.max(madeMeters / RESIZED, Math.min(madeMeters * RESIZED, this.metersPerUnit * factor));
    this.origin = sum(here, this.way(head), -1);
  }

  /** Go where a point of the ground is. point, head: m */
  go(point, head) {
    this.origin = sum(sum(this.origin, this.way(point)), this.way(head), -1);
  }

  /** From the scene to a camera with OpenCV axes, by rows; its unit stays that of the scene. inverse: of the camera's pose, as of WebXR. */
  worldToCamera(inverse) {
    const axes = this.axes();
    const rows = [0, 1, 2].flatMap((row) => {
      const sign = row ? -1 : 1, part = [0, 1, 2].map((column) => sign * inverse[4 * column + row]);
      const axis = sum(sum(scaled(axes[0], part[0]), axes[1], part[1]), axes[2], part[2]);
      return [...axis, (sign * inverse[12 + row]) / this.metersPerUnit - dot(axis, this.origin)];
    });
    return [...rows, 0, 0, 0, 1];
  }
}

/** Of a picture so wide and high, in pixels, from a projection as of WebXR. */
function projectedLens(projection, width, height) {
  return {
    focal: [(projection[0] * width) / 2, (projection[5] * height) / 2],
    center: [((1 - projection[8]) * width) / 2, ((1 + projection[9]) * height) / 2],
  };
}
