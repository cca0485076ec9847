// Gaussians with WebGPU: projected, sorted and drawn as splat.vert and splat.frag do it. ALPHA_MIN, ALPHA_MAX, EPS2D_PX2 and
// FRUSTUM_MARGIN come from engine.conventions.

struct View {
    world_to_camera: mat4x4f,
    focal_px: vec2f,
    center_px: vec2f,
    size_px: vec2f,
    near: f32,
    n_still: u32, // rows that are seen of what stands still, from 0 on
    first_moving: u32,
    end: u32, // of the rows that are seen of what moves
}

struct Row {
    mean_opacity: vec4f,
    quat: vec4f, // wxyz
    scale: vec4f,
}

struct Ellipse {
    mean_px: vec2f,
    major_px: vec2f, // a standard deviation along an axis
    minor_px: vec2f,
    reach_sigma: vec2f,
    color_opacity: vec4f,
}

struct Draw { // arguments of an indirect draw
    n_corners: u32,
    n: atomic<u32>,
    first_corner: u32,
    first: u32,
}

struct Stride { // of a bitonic sort: runs of `run` pairs become ordered, comparing `reach` apart
    run: u32,
    reach: u32,
}

const SNAP_PX = 1.0 / 16.0;
const NOT_SEEN = 0xffffffffu;
const GROUP = 256u;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> rows: array<Row>;
@group(0) @binding(2) var<storage, read> colors: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> ellipses: array<Ellipse>;
@group(0) @binding(4) var<storage, read_write> pairs: array<vec2u>; // of depth, as bits that rise from far to near, and number
@group(0) @binding(5) var<storage, read_write> draw: Draw;
@group(1) @binding(0) var<uniform> stride: Stride;

fn rotation_of(wxyz: vec4f) -> mat3x3f {
    let q = normalize(wxyz);
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    return mat3x3f(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) at: vec3u) {
    let id = at.x;
    if (id >= arrayLength(&pairs)) {
        return;
    }
    pairs[id] = vec2u(NOT_SEEN, id);
    if (id >= view.end || (id >= view.n_still && id < view.first_moving)) {
        return;
    }
    let row = rows[id];
    let opacity = row.mean_opacity.w;
    let p = (view.world_to_camera * vec4f(row.mean_opacity.xyz, 1.0)).xyz;
    if (!(p.z > view.near) || !(opacity > ALPHA_MIN)) {
        return;
    }
    let slope = p.xy / p.z;
    let mean_px = view.focal_px * slope + view.center_px;
    let margin = FRUSTUM_MARGIN * view.size_px;
    let held = clamp(slope, -(view.center_px + margin) / view.focal_px, (view.size_px - view.center_px + margin) / view.focal_px);

    let to_camera = view.world_to_camera;
    let axes = transpose(mat3x3f(to_camera[0].xyz, to_camera[1].xyz, to_camera[2].xyz) * rotation_of(row.quat));
    let row_x = view.focal_px.x / p.z * (axes[0] - held.x * axes[2]) * row.scale.xyz;
    let row_y = view.focal_px.y / p.z * (axes[1] - held.y * axes[2]) * row.scale.xyz;
    var xx = dot(row_x, row_x);
    var yy = dot(row_y, row_y);
    let xy = dot(row_x, row_y);
    let minors = cross(row_x, row_y);
    let determinant = dot(minors, minors) + EPS2D_PX2 * (xx + yy) + EPS2D_PX2 * EPS2D_PX2;
    xx += EPS2D_PX2;
    yy += EPS2D_PX2;

    let half_difference = 0.5 * (xx - yy);
    let radius = length(vec2f(half_difference, xy));
    let major = 0.5 * (xx + yy) + radius;
    var axis = vec2f(1.0, 0.0);
    if (radius > 0.0) {
        axis = normalize(select(vec2f(xy, radius - half_difference), vec2f(half_difference + radius, xy), half_difference >= 0.0));
    }
    let reach_sigma = sqrt(2.0 * log(opacity / ALPHA_MIN));
    let extent_px = reach_sigma * sqrt(vec2f(xx, yy));
    if (!(all(mean_px + extent_px > vec2f(0.0)) && all(mean_px - extent_px < view.size_px))) {
        return;
    }
    let sigma_px = sqrt(vec2f(major, determinant / major));
    let across = vec2f(-axis.y, axis.x);
    let reach = reach_sigma + SNAP_PX / sigma_px;
    ellipses[id] = Ellipse(mean_px, sigma_px.x * axis, sigma_px.y * across, reach, vec4f(colors[id].rgb, opacity));
    pairs[id].x = ~bitcast<u32>(p.z);
    atomicAdd(&draw.n, 1u);
}

/** Of two at the same depth the later one is behind. */
fn is_after(a: vec2u, b: vec2u) -> bool {
    return a.x > b.x || (a.x == b.x && a.y < b.y);
}

@compute @workgroup_size(256)
fn sort_far(@builtin(global_invocation_id) at: vec3u) {
    let low = 2u * stride.reach * (at.x / stride.reach) + at.x % stride.reach;
    let high = low + stride.reach;
    if (high >= arrayLength(&pairs)) {
        return;
    }
    let a = pairs[low];
    let b = pairs[high];
    if (is_after(a, b) == ((low & stride.run) == 0u)) {
        pairs[low] = b;
        pairs[high] = a;
    }
}

var<workgroup> held: array<vec2u, 512>;

/** All that is compared within 512 pairs, of runs up to `run`, beginning with those that are `reach` apart. */
@compute @workgroup_size(256)
fn sort_near(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) at: vec3u) {
    let first = 2u * GROUP * group.x;
    held[at.x] = pairs[first + at.x];
    held[at.x + GROUP] = pairs[first + at.x + GROUP];
    workgroupBarrier();
    for (var run = 2u * stride.reach; run <= stride.run; run *= 2u) {
        for (var reach = min(run / 2u, GROUP); reach > 0u; reach /= 2u) {
            let low = 2u * reach * (at.x / reach) + at.x % reach;
            let a = held[low];
            let b = held[low + reach];
            if (is_after(a, b) == (((first + low) & run) == 0u)) {
                held[low] = b;
                held[low + reach] = a;
            }
            workgroupBarrier();
        }
    }
    pairs[first + at.x] = held[at.x];
    pairs[first + at.x + GROUP] = held[at.x + GROUP];
}

struct Corner {
    @builtin(position) place: vec4f,
    @location(0) offset_sigma: vec2f,
    @location(1) @interpolate(flat) color_opacity: vec4f,
}

@group(0) @binding(0) var<uniform> seen: View;
@group(0) @binding(1) var<storage, read> shapes: array<Ellipse>;
@group(0) @binding(2) var<storage, read> order: array<vec2u>;

@vertex
fn corner_of(@builtin(vertex_index) corner: u32, @builtin(instance_index) number: u32) -> Corner {
    let shape = shapes[order[number].y];
    let offset = (2.0 * vec2f(f32(corner & 1u), f32(corner >> 1u)) - 1.0) * shape.reach_sigma;
    let px = shape.mean_px + offset.x * shape.major_px + offset.y * shape.minor_px;
    let place = (2.0 * px / seen.size_px - 1.0) * vec2f(1.0, -1.0);
    return Corner(vec4f(place, 0.0, 1.0), offset, shape.color_opacity);
}

@fragment
fn color_of(corner: Corner) -> @location(0) vec4f {
    let alpha = corner.color_opacity.a * exp(-0.5 * dot(corner.offset_sigma, corner.offset_sigma));
    if (alpha < ALPHA_MIN) {
        discard;
    }
    let held_alpha = min(alpha, ALPHA_MAX);
    return vec4f(corner.color_opacity.rgb * held_alpha, held_alpha);
}

@group(0) @binding(0) var finished: texture_2d<f32>;

@vertex
fn whole(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(2.0 * vec2f(f32(corner & 1u), f32(corner >> 1u)) - 1.0, 0.0, 1.0);
}

@fragment
fn present(@builtin(position) place: vec4f) -> @location(0) vec4f {
    return vec4f(textureLoad(finished, vec2u(place.xy), 0).rgb, 1.0);
}
