// Smooth edges: finds the pixels whose neighbours lie on another surface, and mixes further samples of them into the
// picture. What lies inside a surface is smooth as it is, and sampled once.

@group(0) @binding(0) var seen_depth: texture_2d<f32>;
@group(0) @binding(1) var seen_label: texture_2d<u32>;
@group(0) @binding(2) var seen_cos: texture_2d<f32>;
@group(1) @binding(0) var edges: texture_2d<f32>;
@group(2) @binding(0) var sample_color: texture_2d<f32>;

@vertex
fn vs_whole(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the picture.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}

// Depths may differ by this share, cosines of incidence by this much, within one smooth surface.
const SAME_DEPTH = 0.02;
const SAME_COS = 0.1;

// 1 where a neighbour lies on another surface, else 0.
@fragment
fn fs_find(@builtin(position) clip: vec4f) -> @location(0) f32 {
    let at = vec2i(clip.xy);
    let last = vec2i(textureDimensions(seen_depth)) - 1;
    let depth = textureLoad(seen_depth, at, 0).x;
    let label = textureLoad(seen_label, at, 0).x;
    let cos_incidence = textureLoad(seen_cos, at, 0).x;
    var edge = false;
    for (var i = 0; i < 4; i++) {
        let side = select(-1, 1, (i & 1) == 1);
        let next = clamp(at + select(vec2i(side, 0), vec2i(0, side), i > 1), vec2i(0), last);
        edge = edge || textureLoad(seen_label, next, 0).x != label
            || abs(textureLoad(seen_depth, next, 0).x - depth) > SAME_DEPTH * depth
            || abs(textureLoad(seen_cos, next, 0).x - cos_incidence) > SAME_COS;
    }
    return select(0.0, 1.0, edge);
}

fn is_edge(clip: vec4f) -> bool {
    return textureLoad(edges, vec2i(clip.xy), 0).x > 0.5;
}

// Opens the depth buffer (reversed: 0 is far, 1 nearest) at edges and closes it everywhere else.
@fragment
fn fs_open(@builtin(position) clip: vec4f) -> @builtin(frag_depth) f32 {
    return select(1.0, 0.0, is_edge(clip));
}

// At edges, a further sample; its alpha is its weight in the mean of all so far.
fn mixed(clip: vec4f, weight: f32) -> vec4f {
    if !is_edge(clip) {
        discard;
    }
    return vec4f(textureLoad(sample_color, vec2i(clip.xy), 0).rgb, weight);
}

@fragment
fn fs_second(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    return mixed(clip, 0.5);
}

@fragment
fn fs_third(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    return mixed(clip, 0.3333333);
}

@fragment
fn fs_fourth(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    return mixed(clip, 0.25);
}
