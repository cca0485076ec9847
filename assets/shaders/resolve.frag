#version 330 core
// Premultiplied picture over an opaque background. The 8-bit target rounds to nearest.

uniform sampler2D picture;
uniform vec3 background;

out vec4 color;

void main() {
    vec4 drawn = texelFetch(picture, ivec2(gl_FragCoord.xy), 0);
    color = vec4(drawn.rgb + (1.0 - drawn.a) * background, 1.0);
}
