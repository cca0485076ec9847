#version 330 core
// One line per instance, cut at the near plane and widened on the screen.

const vec4 OUTSIDE = vec4(2.0, 2.0, 2.0, 1.0);

uniform mat4 world_to_clip;
uniform vec2 size_px;
uniform float half_width_px;

in vec3 start;
in vec4 start_color;
in vec3 end;
in vec4 end_color;

out vec4 line_color;
out float across_px;

void main() {
    line_color = vec4(0.0);
    across_px = 0.0;
    gl_Position = OUTSIDE;

    vec4 a = world_to_clip * vec4(start, 1.0);
    vec4 b = world_to_clip * vec4(end, 1.0);
    float a_inside = a.z + a.w; // 0 on the near plane, negative nearer than it
    float b_inside = b.z + b.w;
    if (a_inside < 0.0 && b_inside < 0.0) {
        return;
    }
    vec4 a_color = start_color, b_color = end_color;
    if (a_inside < 0.0) {
        float share = a_inside / (a_inside - b_inside);
        a_color = mix(a_color, b_color, share);
        a = mix(a, b, share);
    } else if (b_inside < 0.0) {
        float share = b_inside / (b_inside - a_inside);
        b_color = mix(b_color, a_color, share);
        b = mix(b, a, share);
    }

    vec3 a_ndc = a.xyz / a.w, b_ndc = b.xyz / b.w;
    vec2 along_px = 0.5 * (b_ndc.xy - a_ndc.xy) * size_px;
    vec2 along = length(along_px) > 1e-6 ? normalize(along_px) : vec2(1.0, 0.0);
    bool is_end = (gl_VertexID & 1) == 1;
    float side = (gl_VertexID >> 1) == 1 ? 1.0 : -1.0;
    float reach_px = half_width_px + 0.5; // room for the smooth edge
    across_px = side * reach_px;
    line_color = is_end ? b_color : a_color;
    // Ends reach out by half the width, so that the corners of a frustum close.
    vec2 offset_px = across_px * vec2(-along.y, along.x) + (is_end ? half_width_px : -half_width_px) * along;
    vec3 ndc = is_end ? b_ndc : a_ndc;
    gl_Position = vec4(ndc.xy + 2.0 * offset_px / size_px, ndc.z, 1.0);
}
