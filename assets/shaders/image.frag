#version 330 core
// One picture left of a divider, another right of it. For a single picture both are the same and the divider is 0 wide.

uniform sampler2D left_image;
uniform sampler2D right_image;
uniform float divider_x_px;
uniform float divider_px;
uniform vec3 divider_color;

in vec2 uv;
out vec4 color;

void main() {
    float offset_px = gl_FragCoord.x - divider_x_px;
    vec3 picture = offset_px < 0.0 ? texture(left_image, uv).rgb : texture(right_image, uv).rgb;
    color = vec4(abs(offset_px) < 0.5 * divider_px ? divider_color : picture, 1.0);
}
