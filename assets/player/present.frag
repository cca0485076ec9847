#version 330 core
// The finished picture, whose row 0 is the top row, on a rectangle of a canvas, whose row 0 is the bottom row.

uniform sampler2D picture;
uniform vec4 place; // left, bottom, width and height of the rectangle, pixels

out vec4 color;

void main() {
    vec2 share = (gl_FragCoord.xy - place.xy) / place.zw;
    color = vec4(texture(picture, vec2(share.x, 1.0 - share.y)).rgb, 1.0);
}
