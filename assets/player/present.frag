#version 330 core
// The finished picture, whose row 0 is the top row, on a canvas, whose row 0 is the bottom row.

uniform sampler2D picture;
uniform int height;

out vec4 color;

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    color = vec4(texelFetch(picture, ivec2(place.x, height - 1 - place.y), 0).rgb, 1.0);
}
