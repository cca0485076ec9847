#version 330 core
// One colour, premultiplied.

uniform vec4 shade;

out vec4 color;

void main() {
    color = vec4(shade.rgb * shade.a, shade.a);
}
