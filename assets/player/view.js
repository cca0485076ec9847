// Where one looks from: an orbit around a pivot, or a camera of the capture. OpenCV axes: x right, y down, z forward.

const RADIANS_PER_PX = 0.006;
const MAX_PITCH = (89 * Math.PI) / 180;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const sum = (a, b, share = 1) => [a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]];
const scaled = (a, factor) => [factor * a[0], factor * a[1], factor * a[2]];

class View {
  /** header: up, cameras, radius and home, as in docs/player_format.md. */
  constructor(header) {
    this.up = header.up;
    this.cameras = header.cameras;
    this.header = header;
    this.camera = null; // number of the camera that is looked through
    const seed = [0, 0, 0];
    seed[this.up.map(Math.abs).indexOf(Math.min(...this.up.map(Math.abs)))] = 1;
    const level = cross(seed, this.up);
    this.level = scaled(level, 1 / Math.sqrt(dot(level, level)));
    this.home();
  }

  home() {
    const { world_to_camera, distance, fov_y, aspect } = this.header.home;
    this.camera = null;
    this.aspect = aspect;
    this.stand(world_to_camera, distance, fov_y);
  }

  look(camera) {
    this.camera = camera;
  }

  /** Go on freely from where a camera stands, as it is turned. */
  leave() {
    if (this.camera === null) return;
    const { world_to_camera, height, width, K, distance } = this.cameras[this.camera];
    this.camera = null;
    this.aspect = width / height;
    this.stand(world_to_camera, distance, 2 * Math.atan(height / (2 * K[1])));
  }

  stand(matrix, distance, fovY) {
    const [right, down, forward] = [0, 4, 8].map((at) => matrix.slice(at, at + 3));
    const move = [matrix[3], matrix[7], matrix[11]];
    const eye = scaled(sum(sum(scaled(right, move[0]), down, move[1]), forward, move[2]), -1);
    this.distance = distance;
    this.fovY = fovY;
    this.pivot = sum(eye, forward, distance);
    this.turnTo(right, forward);
  }

  turnTo(right, forward) {
    const rise = Math.max(-1, Math.min(1, dot(forward, this.up))), [e0, e1] = this.levelAxes();
    let level = sum(forward, this.up, -rise);
    this.roll = 0;
    if (dot(level, level) < 1e-12) {
      level = cross(this.up, right);
      this.pitch = (-Math.sign(rise) * Math.PI) / 2;
      this.yaw = Math.atan2(dot(level, e1), dot(level, e0));
      return;
    }
    this.yaw = Math.atan2(dot(level, e1), dot(level, e0));
    this.pitch = -Math.asin(rise);
    const axes = this.axes();
    this.roll = Math.atan2(dot(right, axes[1]), dot(right, axes[0]));
  }

  levelAxes() {
    return [this.level, cross(this.up, this.level)];
  }

  /** Right, down and forward directions of the free view. */
  axes() {
    const [e0, e1] = this.levelAxes(), { up, yaw, pitch, roll } = this;
    const level = sum(scaled(e0, Math.cos(yaw)), e1, Math.sin(yaw));
    const forward = sum(scaled(level, Math.cos(pitch)), up, -Math.sin(pitch));
    const right = cross(level, up), down = cross(forward, right);
    const rolled = sum(scaled(right, Math.cos(roll)), down, Math.sin(roll));
    return [rolled, cross(forward, rolled), forward];
  }

  orbit(dx, dy) {
    this.leave();
    const cos = Math.cos(this.roll), sin = Math.sin(this.roll);
    const toLeft = RADIANS_PER_PX * (cos * dx - sin * dy), down = RADIANS_PER_PX * (sin * dx + cos * dy);
    const limit = Math.max(MAX_PITCH, Math.abs(this.pitch));
    this.yaw += toLeft;
    this.pitch = Math.max(-limit, Math.min(limit, this.pitch + down));
  }

  /** What lies at the pivot's depth follows the pointer. Pixels, of a picture so wide and high. */
  pan(dx, dy, width, height) {
    this.leave();
    const unit = this.distance / this.focal(width, height), [right, down] = this.axes();
    this.pivot = sum(sum(this.pivot, right, -unit * dx), down, -unit * dy);
  }

  dolly(factor) {
    this.leave();
    this.distance = Math.max(1e-4 * this.header.radius, Math.min(1e4 * this.header.radius, this.distance * factor));
  }

  /** Pixels. On a narrow screen as wide a part of the scene is seen as on a wide one. */
  focal(width, height) {
    return Math.min(height, width / Math.min(this.aspect, 4 / 3)) / (2 * Math.tan(this.fovY / 2));
  }

  /** For Renderer.draw, of a picture so wide and high in pixels. */
  lens(width, height) {
    if (this.camera === null) {
      const focal = this.focal(width, height), axes = this.axes(), eye = sum(this.pivot, axes[2], -this.distance);
      const rows = axes.flatMap((axis) => [...axis, -dot(axis, eye)]);
      return { worldToCamera: [...rows, 0, 0, 0, 1], focal: [focal, focal], center: [width / 2, height / 2] };
    }
    const { K, world_to_camera, ...size } = this.cameras[this.camera]; // fitted, so that nothing is cut off
    const scale = Math.min(width / size.width, height / size.height);
    return {
      worldToCamera: world_to_camera,
      focal: [scale * K[0], scale * K[1]],
      center: [scale * K[2] + (width - scale * size.width) / 2, scale * K[3] + (height - scale * size.height) / 2],
    };
  }
}
