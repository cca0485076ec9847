// In the worker: the picture itself, where the graphics card is only played by the processor. As splat.vert and splat.frag
// draw it, but from front to back, so that what is hidden costs nearly nothing, and only inside the ellipses.

const EXP_STEPS = 4096;
const LEAST_SEEN = 1 / 256; // what shines through; no more is painted where less does
const FLOATS_PER_ROW = 4 * TEXELS_PER_ROW;

class Painter {
  constructor() {
    const most = 2 * Math.log(1 / ALPHA_MIN); // squared distance in standard deviations
    this.perSquare = EXP_STEPS / most;
    this.exps = Float64Array.from({ length: EXP_STEPS + 2 }, (_, i) => Math.exp((-0.5 * (i + 0.5)) / this.perSquare));
    this.light = new Float64Array(0); // of each pixel: red, green, blue, and how much still shines through
  }

  /**
   * parts: [{geometry, colors, first}], ascending, as for the textures; order: numbers, farthest first; view: lens as of
   * Renderer.draw, near, size and background. Returns RGBA, 8 bits each, the top row first.
   */
  paint(parts, order, { worldToCamera: m, focal, center, near, size, background }) {
    const [width, height] = size, [fx, fy] = focal, [cx, cy] = center;
    if (this.light.length !== 4 * width * height) this.light = new Float64Array(4 * width * height);
    this.light.fill(0);
    for (let i = 3; i < this.light.length; i += 4) this.light[i] = 1;
    const lowX = -(cx + FRUSTUM_MARGIN * width) / fx, highX = (width - cx + FRUSTUM_MARGIN * width) / fx;
    const lowY = -(cy + FRUSTUM_MARGIN * height) / fy, highY = (height - cy + FRUSTUM_MARGIN * height) / fy;
    const [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11] = m;
    const split = parts[1].first, still = parts[0], moving = parts[1];
    for (let number = order.length - 1; number >= 0; number--) {
      const id = order[number], isStill = id < split, { geometry, colors } = isStill ? still : moving;
      const row = isStill ? id : id - split, g = FLOATS_PER_ROW * row, opacity = geometry[g + 3];
      const x = geometry[g], y = geometry[g + 1], z = geometry[g + 2];
      const pz = m8 * x + m9 * y + m10 * z + m11;
      if (!(pz > near) || !(opacity > ALPHA_MIN)) continue;
      const slopeX = (m0 * x + m1 * y + m2 * z + m3) / pz, slopeY = (m4 * x + m5 * y + m6 * z + m7) / pz;
      const meanX = fx * slopeX + cx, meanY = fy * slopeY + cy;
      const heldX = Math.min(Math.max(slopeX, lowX), highX), heldY = Math.min(Math.max(slopeY, lowY), highY);

      // Rows of (Jacobian * camera rotation), then along each of the Gaussian's axes.
      const jx = fx / pz, jy = fy / pz;
      const ax = jx * (m0 - heldX * m8), ay = jx * (m1 - heldX * m9), az = jx * (m2 - heldX * m10);
      const bx = jy * (m4 - heldY * m8), by = jy * (m5 - heldY * m9), bz = jy * (m6 - heldY * m10);
      let qw = geometry[g + 4], qx = geometry[g + 5], qy = geometry[g + 6], qz = geometry[g + 7];
      const unit = 1 / Math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz);
      qw *= unit;
      qx *= unit;
      qy *= unit;
      qz *= unit;
      const sx = geometry[g + 8], sy = geometry[g + 9], sz = geometry[g + 10];
      const r00 = sx * (1 - 2 * (qy * qy + qz * qz)), r10 = sx * 2 * (qx * qy + qw * qz), r20 = sx * 2 * (qx * qz - qw * qy);
      const r01 = sy * 2 * (qx * qy - qw * qz), r11 = sy * (1 - 2 * (qx * qx + qz * qz)), r21 = sy * 2 * (qy * qz + qw * qx);
      const r02 = sz * 2 * (qx * qz + qw * qy), r12 = sz * 2 * (qy * qz - qw * qx), r22 = sz * (1 - 2 * (qx * qx + qy * qy));
      const u0 = ax * r00 + ay * r10 + az * r20, u1 = ax * r01 + ay * r11 + az * r21, u2 = ax * r02 + ay * r12 + az * r22;
      const v0 = bx * r00 + by * r10 + bz * r20, v1 = bx * r01 + by * r11 + bz * r21, v2 = bx * r02 + by * r12 + bz * r22;
      const xx = u0 * u0 + u1 * u1 + u2 * u2, yy = v0 * v0 + v1 * v1 + v2 * v2, xy = u0 * v0 + u1 * v1 + u2 * v2;
      const c0 = u1 * v2 - u2 * v1, c1 = u2 * v0 - u0 * v2, c2 = u0 * v1 - u1 * v0;
      const determinant = c0 * c0 + c1 * c1 + c2 * c2 + EPS2D_PX2 * (xx + yy) + EPS2D_PX2 * EPS2D_PX2;
      const xxWide = xx + EPS2D_PX2, yyWide = yy + EPS2D_PX2;

      const reach = 2 * Math.log(opacity / ALPHA_MIN); // squared
      const tall = Math.sqrt(reach * yyWide), wide = Math.sqrt(reach * xxWide);
      if (!(meanX + wide > 0 && meanX - wide < width && meanY + tall > 0 && meanY - tall < height)) continue;
      const a = yyWide / determinant, b = -xy / determinant, c = 4 * row;
      const top = Math.max(0, Math.ceil(meanY - tall - 0.5)), bottom = Math.min(height - 1, Math.floor(meanY + tall - 0.5));
      for (let line = top; line <= bottom; line++) {
        const dy = line + 0.5 - meanY, inside = a * reach - (dy * dy) / determinant;
        if (!(inside > 0)) continue;
        const half = Math.sqrt(inside) / a, middle = meanX - (b * dy) / a;
        const left = Math.max(0, Math.ceil(middle - half - 0.5)), right = Math.min(width - 1, Math.floor(middle + half - 0.5));
        const along = left + 0.5 - middle; // a (x - middle)^2 + dy^2 / (a determinant) is the squared distance
        const distance = this.perSquare * (a * along * along + (dy * dy) / (determinant * a));
        const change = this.perSquare * a * (2 * along + 1), begin = line * width;
        this.fill(begin + left, begin + right, distance, change, 2 * a * this.perSquare, opacity, colors[c], colors[c + 1], colors[c + 2]);
      }
    }
    return this.pixels(background);
  }

  /** Pixels of one line from the first to the last one; distances are steps of the table, and so are their changes. */
  fill(first, last, distance, change, changes, opacity, red, green, blue) {
    const { light, exps } = this, end = 4 * last;
    for (let at = 4 * first; at <= end; at += 4) {
      const rest = light[at + 3];
      if (rest > LEAST_SEEN) {
        const alpha = opacity * exps[distance | 0], share = (alpha < ALPHA_MAX ? alpha : ALPHA_MAX) * rest;
        light[at] += share * red;
        light[at + 1] += share * green;
        light[at + 2] += share * blue;
        light[at + 3] = rest - share;
      }
      distance += change;
      change += changes;
    }
  }

  /** What was painted, over a background. RGBA, 8 bits each */
  pixels([redBehind, greenBehind, blueBehind]) {
    const { light } = this, pixels = new Uint8ClampedArray(light.length);
    for (let at = 0; at < light.length; at += 4) {
      const rest = light[at + 3], isFull = rest <= LEAST_SEEN; // then what was left out is taken to be as the rest
      const gain = isFull ? 255 / (1 - rest) : 255, behind = isFull ? 0 : 255 * rest;
      pixels[at] = gain * light[at] + behind * redBehind;
      pixels[at + 1] = gain * light[at + 1] + behind * greenBehind;
      pixels[at + 2] = gain * light[at + 2] + behind * blueBehind;
      pixels[at + 3] = 255;
    }
    return pixels;
  }
}
