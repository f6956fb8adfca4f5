// Half-shadows of the single rays of shade.wgsl: the mean of four by four neighbours, taken where four such squares overlap
// (so that it lies evenly about the pixel) and of the same surface only; along rows first, along columns next.

// Whether this pass goes along rows or along columns.
override ALONG_ROWS: bool = true;

@group(0) @binding(0) var seen_surface: texture_2d<u32>;
@group(0) @binding(1) var shares: texture_2d<f32>;

@fragment
fn fs_soften(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    let at = vec2i(clip.xy);
    let last = vec2i(textureDimensions(seen_surface)) - 1;
    let surface = textureLoad(seen_surface, at, 0).x;
    let along = select(vec2i(0, 1), vec2i(1, 0), ALONG_ROWS);
    var sum = 2.0 * textureLoad(shares, at, 0);
    var weight = 2.0;
    for (var i = 0; i < 4; i++) {
        // Two to either side, the outer ones by half.
        let side = select(i - 2, i - 1, i > 1);
        let next = clamp(at + side * along, vec2i(0), last);
        let apart = difference(textureLoad(seen_surface, next, 0).x, surface);
        let w = select(0.0, select(2.0, 1.0, abs(side) == 2), apart < SAME_NORMAL * SAME_NORMAL);
        sum += w * textureLoad(shares, next, 0);
        weight += w;
    }
    return sum / weight;
}
