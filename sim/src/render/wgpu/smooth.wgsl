// Smooth edges. Where neighbours lie on different surfaces a pixel has three more samples of what is nearest there
// (instance, normal, depth), but no colour for them: each takes that of the pixel among its neighbours that shows the same
// surface (subpixel reconstruction antialiasing, Chajdas, McGuire and Luebke 2011). Inside a surface a pixel stays as it is.

@group(0) @binding(0) var seen_depth: texture_2d<f32>;
@group(0) @binding(1) var seen_surface: texture_2d<u32>;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var sample_surface: texture_2d_array<u32>;
@group(0) @binding(4) var sample_depth: texture_depth_2d_array;
// See prepare.wgsl.
@group(0) @binding(5) var prepared: texture_2d<f32>;

// Distance of the near plane, metres: the depth buffer holds NEAR / z.
const NEAR = 0.02;

@fragment
fn fs_smooth(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    let at = vec2i(clip.xy);
    let last = vec2i(textureDimensions(seen_depth)) - 1;
    var sum = textureLoad(color, at, 0);
    // No early return, see light.wgsl.
    let samples = select(0, 3, textureLoad(prepared, at, 0).y > 0.5);
    for (var s = 0; s < samples; s++) {
        let wanted = textureLoad(sample_surface, at, s, 0).x;
        // 0 where nothing is hit, as in the depth image.
        let buffer = textureLoad(sample_depth, at, s, 0);
        let z = select(0.0, NEAR / buffer, buffer > 0.0);
        var least = 1e9;
        var best = at;
        for (var i = 0; i < 5; i++) {
            // Right, left, below, above, and the pixel itself.
            let side = select(1, -1, (i & 1) == 1);
            let step = select(vec2i(side, 0), vec2i(0, side), i > 1);
            let next = clamp(at + select(step, vec2i(0), i == 4), vec2i(0), last);
            let apart = abs(textureLoad(seen_depth, next, 0).x - z) / max(z, 0.01);
            // The pixel itself wins among equals.
            let score = difference(textureLoad(seen_surface, next, 0).x, wanted) + 10.0 * apart
                + select(0.001, 0.0, i == 4);
            if score < least {
                least = score;
                best = next;
            }
        }
        sum += textureLoad(color, best, 0);
    }
    return sum / f32(samples + 1);
}
