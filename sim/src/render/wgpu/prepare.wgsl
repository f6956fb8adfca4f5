// What of a view does not depend on its light, once for each geometry: how much of the ambient light reaches a pixel, and
// whether neighbours lie on other surfaces. The formulas of the former are those of occlusion.rs, line by line.

const PI = 3.14159265358979;

struct Light {
    position: vec3f,
    // Cosine of the cone's edge and of its hot spot's edge.
    cos_outer: f32,
    axis: vec3f,
    cos_inner: f32,
    // Candela a channel.
    intensity: vec3f,
    // First layer of its shadow map, -1 for none.
    first_layer: i32,
    // 1 for one view, 6 for a cube.
    faces: u32,
    // Radius of the luminous disk, metres.
    radius: f32,
    // Half width of the shadow map at a distance of 1 m along its axis, metres.
    tangent: f32,
    // Inverse distances, 1/m, of depth 0 and depth 1 of the shadow map.
    inverse_near: f32,
    inverse_far: f32,
}

struct Frame {
    // fx, fy, cx, cy of the pixels.
    intrinsics: vec4f,
    up: vec3f,
    padding: f32,
    // Lux a channel on a surface that faces up, and on one that faces down.
    sky: vec3f,
    light_count: u32,
    ground: vec3f,
    bounce_radius: f32,
    bounce_center: vec3f,
    bounce_lowest: f32,
    bounce_lux: vec3f,
    // Where nothing is hit.
    background: vec3f,
    lights: array<Light, 4>,
    // Rigid transforms to the frames of the shadow maps' views, z along the view.
    light_from_camera: array<mat4x4f, 24>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var seen_depth: texture_2d<f32>;
@group(1) @binding(1) var seen_surface: texture_2d<u32>;
@group(1) @binding(2) var seen_normal: texture_2d<f32>;

@vertex
fn vs_whole(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the picture.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}

// Interleaved gradient noise (Jimenez 2014): an angle a pixel.
fn rotation(pixel: vec2f) -> f32 {
    return 2.0 * PI * fract(52.982918 * fract(dot(pixel, vec2f(0.06711056, 0.00583715))));
}

// Cosine and sine of the golden angle: a spiral of steps by it covers a disk evenly (Vogel 1979).
const GOLDEN = vec2f(-0.73736888, 0.67549029);

fn turn(v: vec2f) -> vec2f {
    return vec2f(v.x * GOLDEN.x - v.y * GOLDEN.y, v.x * GOLDEN.y + v.y * GOLDEN.x);
}

const AO_RADIUS = 0.09;
const AO_TAPS = 8;

fn open_share(pixel: vec2f, spiral: vec2f, point: vec3f, normal: vec3f) -> f32 {
    let k = frame.intrinsics;
    let last = vec2f(textureDimensions(seen_depth) - 1u);
    let reach = min(k.x * AO_RADIUS / point.z, 72.0);
    let lowest = 0.0015 * point.z;
    var direction = spiral;
    var kept = 0.0;
    for (var i = 0; i < AO_TAPS; i++) {
        let step = direction * sqrt((f32(i) + 0.5) / f32(AO_TAPS));
        direction = turn(direction);
        let at = clamp(floor(pixel + reach * step + 0.5), vec2f(0.0), last);
        let z = textureLoad(seen_depth, vec2i(at), 0).x;
        let offset = vec3f((at - k.zw) / k.xy * z, z) - point;
        let squared = dot(offset, offset);
        let rise = max(dot(offset, normal) - lowest, 0.0);
        kept += rise * inverseSqrt(max(squared, 1e-12)) * max(1.0 - squared / (AO_RADIUS * AO_RADIUS), 0.0);
    }
    return clamp(1.0 - 2.0 * kept / f32(AO_TAPS), 0.0, 1.0);
}

// Depths may differ by this share, normals by this much, within one smooth surface.
const SAME_DEPTH = 0.02;
const SAME_NORMAL = 0.35;

// How much the normals of two surfaces (see geometry.wgsl) differ, squared; large for different instances.
fn difference(a: u32, b: u32) -> f32 {
    let x = (f32((a >> 8u) & 255u) - f32((b >> 8u) & 255u)) / 127.5;
    let y = (f32(a & 255u) - f32(b & 255u)) / 127.5;
    return x * x + y * y + select(0.0, 100.0, ((a ^ b) & 0xffff0000u) != 0u);
}

fn is_edge(at: vec2i, depth: f32) -> bool {
    let last = vec2i(textureDimensions(seen_depth)) - 1;
    let surface = textureLoad(seen_surface, at, 0).x;
    var edge = false;
    for (var i = 0; i < 4; i++) {
        let side = select(-1, 1, (i & 1) == 1);
        let next = clamp(at + select(vec2i(side, 0), vec2i(0, side), i > 1), vec2i(0), last);
        edge = edge || abs(textureLoad(seen_depth, next, 0).x - depth) > SAME_DEPTH * depth
            || difference(textureLoad(seen_surface, next, 0).x, surface) > SAME_NORMAL * SAME_NORMAL;
    }
    return edge;
}

// Open share, and 1 for an edge.
@fragment
fn fs_prepare(@builtin(position) clip: vec4f) -> @location(0) vec2f {
    let pixel = floor(clip.xy);
    let at = vec2i(pixel);
    let depth = textureLoad(seen_depth, at, 0).x;
    let edge = select(0.0, 1.0, is_edge(at, depth));
    if depth <= 0.0 {
        return vec2f(1.0, edge);
    }
    let k = frame.intrinsics;
    let point = vec3f((pixel - k.zw) / k.xy * depth, depth);
    let normal = normalize(2.0 * textureLoad(seen_normal, at, 0).xyz - 1.0);
    let angle = rotation(pixel);
    return vec2f(open_share(pixel, vec2f(cos(angle), sin(angle)), point, normal), edge);
}
