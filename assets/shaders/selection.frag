#version 330 core
// What is selected: a tint with stripes, and a line around it, so that it shows without its hue too. Premultiplied.

uniform sampler2D share; // of each pixel that selected Gaussians make up
uniform vec2 size_px;
uniform float unit_px; // pixels per unit of the interface
uniform vec3 hue;
uniform float fill; // 1 with stripes inside, 0 for the line alone

out vec4 color;

const float HALF = 0.5;

float share_at(vec2 at_px) { return texture(share, at_px / size_px).r; }

void main() {
    vec2 at = gl_FragCoord.xy;
    float here = share_at(at);
    float far = 1.5 * unit_px;
    vec4 beside = vec4(share_at(at + vec2(far, 0.0)), share_at(at - vec2(far, 0.0)),
                       share_at(at + vec2(0.0, far)), share_at(at - vec2(0.0, far)));
    float most = max(max(beside.x, beside.y), max(beside.z, beside.w));
    float least = min(min(beside.x, beside.y), min(beside.z, beside.w));
    if (here >= HALF && least < HALF) { // the line
        color = vec4(hue, 1.0);
        return;
    }
    if (here < HALF && most >= HALF) { // its dark rim, which keeps it apart from a picture as bright
        color = vec4(0.0, 0.0, 0.0, 0.75);
        return;
    }
    bool is_stripe = mod(at.x + at.y, 9.0 * unit_px) < 3.0 * unit_px;
    float alpha = smoothstep(0.16, HALF, here) * (is_stripe ? 0.6 : 0.22) * fill;
    color = vec4(hue * alpha, alpha);
}
