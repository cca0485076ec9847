// How Gaussians lie in textures, for the page and its worker: as splat.vert reads them.

const ROWS_PER_LINE = 1024; // Gaussians in a line of a texture
const TEXELS_PER_ROW = 3; // of four floats: mean, opacity | quat wxyz | scale, 0

function lines(n) {
  return Math.ceil(n / ROWS_PER_LINE);
}
