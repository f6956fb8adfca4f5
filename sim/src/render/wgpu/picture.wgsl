// What the passes over the whole picture share: one triangle that covers it, a spiral of taps, and what tells surfaces apart.

const PI = 3.14159265358979;

@vertex
fn vs_whole(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the picture.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}

// Interleaved gradient noise (Jimenez 2014): an angle a pixel.
fn rotation(pixel: vec2f) -> f32 {
    return 2.0 * PI * fract(52.982918 * fract(dot(pixel, vec2f(0.06711056, 0.00583715))));
}

// The golden angle, its cosine and sine: a spiral of steps by it covers a disk evenly (Vogel 1979).
const GOLDEN_ANGLE = 2.3999632;
const GOLDEN = vec2f(-0.73736888, 0.67549029);

fn turn(v: vec2f) -> vec2f {
    return vec2f(v.x * GOLDEN.x - v.y * GOLDEN.y, v.x * GOLDEN.y + v.y * GOLDEN.x);
}

// Normals may differ by this much within one smooth surface.
const SAME_NORMAL = 0.35;

// How much the normals of two surfaces (see geometry.wgsl) differ, squared; large for different instances.
fn difference(a: u32, b: u32) -> f32 {
    let x = (f32((a >> 8u) & 255u) - f32((b >> 8u) & 255u)) / 127.5;
    let y = (f32(a & 255u) - f32(b & 255u)) / 127.5;
    return x * x + y * y + select(0.0, 100.0, ((a ^ b) & 0xffff0000u) != 0u);
}
