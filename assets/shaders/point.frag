#version 330 core
// Marks by their signed distance in pixels: disc, ring, diamond.

const int RING = 1;
const int DIAMOND = 2;
const float RING_SHARE = 0.36; // of the radius
const vec3 RIM_COLOR = vec3(0.04, 0.05, 0.06);

uniform int shape;
uniform float outline_px;
uniform float opacity;
uniform bool is_sharp;

flat in vec4 point_color;
flat in float mark_px;
flat in float sprite_px;
out vec4 color;

void main() {
    vec2 p = abs((gl_PointCoord - 0.5) * sprite_px);
    float radius = 0.5 * mark_px;
    float outside = shape == DIAMOND ? (p.x + p.y - radius) * 0.70710678 : length(p) - radius; // px, negative inside
    if (shape == RING) {
        float thickness = max(RING_SHARE * radius, 1.0) + 2.0 * outline_px; // a rim on both sides
        outside = abs(outside + 0.5 * thickness) - 0.5 * thickness;
    }
    float coverage = clamp(0.5 - outside, 0.0, 1.0);
    if (is_sharp) {
        coverage = step(0.5, coverage);
    }
    float alpha = point_color.a * opacity * coverage;
    if (alpha <= 0.0) {
        discard;
    }
    float rim = outline_px > 0.0 ? clamp(outside + outline_px + 0.5, 0.0, 1.0) : 0.0;
    color = vec4(mix(point_color.rgb, RIM_COLOR, rim) * alpha, alpha);
}
