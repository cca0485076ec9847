#version 330 core
// One Gaussian per instance: EWA projection (Zwicker et al. 2001) to an ellipse, drawn as the rectangle around it.
// ALPHA_MIN, EPS2D_PX2 and FRUSTUM_MARGIN come from engine.conventions.

const int SPLATS_PER_ROW = 1024; // as in ui/gl/splat_rows.py
const float SNAP_PX = 1.0 / 16.0; // drivers may round corners that much, and must not round a pixel away
const vec4 OUTSIDE = vec4(2.0, 2.0, 2.0, 1.0);

uniform sampler2D geometry; // three texels each: mean, opacity | quat wxyz | scale
uniform sampler2D colors; // one each
uniform mat4 world_to_camera;
uniform vec2 focal_px;
uniform vec2 center_px;
uniform vec2 size_px;
uniform float near;

in uint splat_id;

out vec2 offset_sigma; // from the centre along the ellipse's axes, in standard deviations
flat out vec4 color_opacity;

mat3 rotation_of(vec4 wxyz) {
    vec4 q = wxyz / length(wxyz);
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3( // columns
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

void main() {
    offset_sigma = vec2(0.0);
    color_opacity = vec4(0.0);
    gl_Position = OUTSIDE;

    int id = int(splat_id);
    ivec2 place = ivec2(id % SPLATS_PER_ROW, id / SPLATS_PER_ROW);
    ivec2 texel = ivec2(3 * place.x, place.y);
    vec4 mean_opacity = texelFetch(geometry, texel, 0);
    float opacity = mean_opacity.w;
    vec3 p = (world_to_camera * vec4(mean_opacity.xyz, 1.0)).xyz;
    if (!(p.z > near) || !(opacity > ALPHA_MIN)) {
        return;
    }
    vec2 slope = p.xy / p.z;
    vec2 mean_px = focal_px * slope + center_px;

    // Far outside the picture the linear approximation explodes, so its slope is held near the border.
    vec2 margin = FRUSTUM_MARGIN * size_px;
    vec2 held = clamp(slope, -(center_px + margin) / focal_px, (size_px - center_px + margin) / focal_px);

    // Rows of (Jacobian * camera rotation * splat rotation * scale): the screen covariance is rows . rows^T + low-pass.
    vec4 quat = texelFetch(geometry, texel + ivec2(1, 0), 0);
    vec3 scale = texelFetch(geometry, texel + ivec2(2, 0), 0).xyz;
    mat3 axes = mat3(world_to_camera) * rotation_of(quat); // columns: the splat's axes in camera space
    vec3 axes_x = vec3(axes[0].x, axes[1].x, axes[2].x);
    vec3 axes_y = vec3(axes[0].y, axes[1].y, axes[2].y);
    vec3 axes_z = vec3(axes[0].z, axes[1].z, axes[2].z);
    vec3 row_x = focal_px.x / p.z * (axes_x - held.x * axes_z) * scale;
    vec3 row_y = focal_px.y / p.z * (axes_y - held.y * axes_z) * scale;

    float xx = dot(row_x, row_x), yy = dot(row_y, row_y), xy = dot(row_x, row_y);
    // Determinant by Cauchy-Binet, a sum of squares: xx * yy - xy * xy loses all digits for needles.
    vec3 minors = cross(row_x, row_y);
    float determinant = dot(minors, minors) + EPS2D_PX2 * (xx + yy) + EPS2D_PX2 * EPS2D_PX2;
    xx += EPS2D_PX2;
    yy += EPS2D_PX2;

    float half_difference = 0.5 * (xx - yy);
    float radius = length(vec2(half_difference, xy));
    float major = 0.5 * (xx + yy) + radius; // larger eigenvalue, px^2
    float minor = determinant / major;
    vec2 axis = half_difference >= 0.0 ? vec2(half_difference + radius, xy) : vec2(xy, radius - half_difference);
    axis = radius > 0.0 ? normalize(axis) : vec2(1.0, 0.0);

    // Exactly where opacity * exp(-d^2 / 2) falls to ALPHA_MIN.
    float reach_sigma = sqrt(2.0 * log(opacity / ALPHA_MIN));
    vec2 extent_px = reach_sigma * sqrt(vec2(xx, yy));
    bool is_on_screen = all(greaterThan(mean_px + extent_px, vec2(0.0))) && all(lessThan(mean_px - extent_px, size_px));
    if (!is_on_screen) { // also when anything overflowed, because comparisons with NaN are false
        return;
    }

    vec2 corner = 2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1 & 1) - 1.0; // of the first quad or any other
    vec2 sigma_px = sqrt(vec2(major, minor));
    offset_sigma = corner * (reach_sigma + SNAP_PX / sigma_px);
    vec2 offset_px = offset_sigma * sigma_px;
    offset_px = offset_px.x * axis + offset_px.y * vec2(-axis.y, axis.x);
    color_opacity = vec4(texelFetch(colors, place, 0).rgb, opacity);
    gl_Position = vec4(2.0 * (mean_px + offset_px) / size_px - 1.0, 0.0, 1.0);
}
