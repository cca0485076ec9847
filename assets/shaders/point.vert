#version 330 core
// One point sprite per point, a little larger than the mark for its smooth edge.

uniform mat4 world_to_clip;
uniform float size;
uniform float px_per_unit; // 0: size is in pixels
uniform float max_size_px;

in vec3 position;
in vec4 color;

flat out vec4 point_color;
flat out float mark_px;
flat out float sprite_px;

void main() {
    gl_Position = world_to_clip * vec4(position, 1.0);
    point_color = color;
    float wanted_px = px_per_unit > 0.0 ? size * px_per_unit / max(gl_Position.w, 1e-12) : size;
    mark_px = clamp(wanted_px, 1.0, max_size_px - 3.0);
    sprite_px = ceil(mark_px) + 2.0; // a diamond's tips fade over 0.7 px
    gl_PointSize = sprite_px;
}
