// Smooth edges. Where neighbours lie on different surfaces a pixel has three more samples of what is nearest there
// (instance, normal, depth), but no colour for them: each takes that of the pixel among its neighbours that shows the same
// surface (subpixel reconstruction antialiasing, Chajdas, McGuire and Luebke 2011). Inside a surface a pixel stays as it is.

@group(0) @binding(0) var seen_depth: texture_2d<f32>;
@group(0) @binding(1) var seen_label: texture_2d<u32>;
@group(0) @binding(2) var seen_normal: texture_2d<f32>;
@group(0) @binding(3) var color: texture_2d<f32>;
@group(0) @binding(4) var sample_surface: texture_2d_array<u32>;
@group(0) @binding(5) var sample_depth: texture_depth_2d_array;

@vertex
fn vs_whole(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}

// Distance of the near plane, metres: the depth buffer holds NEAR / z.
const NEAR = 0.02;
// Depths may differ by this share, normals by this much, within one smooth surface.
const SAME_DEPTH = 0.02;
const SAME_NORMAL = 0.35;

fn normal_at(at: vec2i) -> vec2f {
    return 2.0 * textureLoad(seen_normal, at, 0).xy - 1.0;
}

@fragment
fn fs_smooth(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    let at = vec2i(clip.xy);
    let last = vec2i(textureDimensions(seen_depth)) - 1;
    let depth = textureLoad(seen_depth, at, 0).x;
    let instance = textureLoad(seen_label, at, 0).x >> 16u;
    let normal = normal_at(at);
    var edge = false;
    for (var i = 0; i < 4; i++) {
        let side = select(-1, 1, (i & 1) == 1);
        let next = clamp(at + select(vec2i(side, 0), vec2i(0, side), i > 1), vec2i(0), last);
        let turned = normal_at(next) - normal;
        edge = edge || textureLoad(seen_label, next, 0).x >> 16u != instance
            || abs(textureLoad(seen_depth, next, 0).x - depth) > SAME_DEPTH * depth
            || dot(turned, turned) > SAME_NORMAL * SAME_NORMAL;
    }
    let here = textureLoad(color, at, 0);
    if !edge {
        return here;
    }
    var sum = here;
    for (var s = 0; s < 3; s++) {
        let surface = textureLoad(sample_surface, at, s, 0).x;
        // 0 where nothing is hit, as in the depth image.
        let buffer = textureLoad(sample_depth, at, s, 0);
        let z = select(0.0, NEAR / buffer, buffer > 0.0);
        let facing = (vec2f(f32((surface >> 8u) & 255u), f32(surface & 255u)) - 127.5) / 127.5;
        var least = 1e9;
        var best = at;
        for (var i = 0; i < 9; i++) {
            let next = clamp(at + vec2i(i % 3 - 1, i / 3 - 1), vec2i(0), last);
            let turned = normal_at(next) - facing;
            let other = select(0.0, 100.0, textureLoad(seen_label, next, 0).x >> 16u != surface >> 16u);
            let apart = abs(textureLoad(seen_depth, next, 0).x - z) / max(z, 0.01);
            // The pixel itself wins among equals.
            let score = other + 10.0 * apart + dot(turned, turned) + select(0.001, 0.0, i == 4);
            if score < least {
                least = score;
                best = next;
            }
        }
        sum += textureLoad(color, best, 0);
    }
    return 0.25 * sum;
}
