#version 330 core
// A rectangle without vertex buffers: the corners follow from gl_VertexID.

uniform vec4 rect_ndc; // x0, y0, x1, y1; y grows downwards, as rows do

out vec2 uv;

void main() {
    uv = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(mix(rect_ndc.xy, rect_ndc.zw, uv), 0.0, 1.0);
}
