#version 330 core
// Premultiplied picture over an opaque background, or kept transparent. The 8-bit target rounds to nearest.

uniform sampler2D picture;
uniform vec3 background;
uniform bool is_transparent;

out vec4 color;

void main() {
    vec4 drawn = texelFetch(picture, ivec2(gl_FragCoord.xy), 0);
    if (is_transparent) { // straight alpha, as ImGui blends
        color = vec4(drawn.rgb / max(drawn.a, 1e-6), drawn.a);
        return;
    }
    color = vec4(drawn.rgb + (1.0 - drawn.a) * background, 1.0);
}
