#version 330 core
// A strip of triangles in front of everything else, such as where somebody in a headset will stand.

uniform mat4 to_camera; // OpenCV axes
uniform vec2 focal_px;
uniform vec2 center_px;
uniform vec2 size_px;

in vec3 place;

void main() {
    vec3 p = (to_camera * vec4(place, 1.0)).xyz;
    gl_Position = vec4(2.0 * (focal_px * p.xy + center_px * p.z) / size_px - p.z, 0.0, p.z);
}
