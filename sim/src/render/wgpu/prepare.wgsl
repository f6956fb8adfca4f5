// What of a view does not depend on its light, once for each geometry: how much of the ambient light reaches a pixel, and
// whether neighbours lie on other surfaces. The formulas of the former are those of occlusion.rs, line by line.

@group(1) @binding(0) var seen_depth: texture_2d<f32>;
@group(1) @binding(1) var seen_surface: texture_2d<u32>;
@group(1) @binding(2) var seen_normal: texture_2d<f32>;

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

// Depths may differ by this share within one smooth surface.
const SAME_DEPTH = 0.02;

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
