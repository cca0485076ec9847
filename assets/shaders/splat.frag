#version 330 core
// Premultiplied colour of one Gaussian at one pixel. ALPHA_MIN and ALPHA_MAX come from engine.conventions.

in vec2 offset_sigma;
flat in vec4 color_opacity;
out vec4 color;

void main() {
    float alpha = color_opacity.a * exp(-0.5 * dot(offset_sigma, offset_sigma));
    if (alpha < ALPHA_MIN) {
        discard;
    }
    alpha = min(alpha, ALPHA_MAX);
    color = vec4(color_opacity.rgb * alpha, alpha);
}
