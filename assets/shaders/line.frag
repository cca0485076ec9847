#version 330 core
// Coverage falls from 1 to 0 over the pixel at the line's edge.

uniform float half_width_px;
uniform float opacity;

in vec4 line_color;
in float across_px;
out vec4 color;

void main() {
    float coverage = clamp(half_width_px + 0.5 - abs(across_px), 0.0, 1.0) * min(2.0 * half_width_px, 1.0);
    float alpha = line_color.a * opacity * coverage;
    if (alpha <= 0.0) {
        discard;
    }
    color = vec4(line_color.rgb * alpha, alpha);
}
