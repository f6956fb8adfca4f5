// How much of each light arrives at every pixel: rays from it to the light's disk, marched through the light's shadow map,
// one to a large light, some to a small one. Neighbours take other points of the disk; soften.wgsl puts them together.

// How many lights there are, and whether any of their shadow maps is a cube.
override LIGHT_COUNT: u32 = 4;
override CUBES: bool = true;

@group(0) @binding(1) var shadow_maps: texture_depth_2d_array;
@group(1) @binding(0) var seen_depth: texture_2d<f32>;
@group(1) @binding(1) var seen_normal: texture_2d<f32>;

// Which face of a cube of views about a light looks towards `v`: +x -x +y -y +z -z.
fn cube_face(v: vec3f) -> u32 {
    let a = abs(v);
    if a.x >= a.y && a.x >= a.z {
        return select(1u, 0u, v.x > 0.0);
    }
    if a.y >= a.z {
        return select(3u, 2u, v.y > 0.0);
    }
    return select(5u, 4u, v.z > 0.0);
}

// Where a ray goes to on a light's disk: the share of the disk that is nearer to its middle, and the direction.
struct Ray {
    share: f32,
    direction: vec2f,
}

// The first ray of a pixel. Any 4 x 4 pixels go to sixteen even shares, each of four such blocks to others within these.
fn first_ray(pixel: vec2u) -> Ray {
    let mixed = pixel.x ^ pixel.y;
    let within = ((mixed & 1u) << 3u) | ((pixel.y & 1u) << 2u) | (mixed & 2u) | ((pixel.y >> 1u) & 1u);
    let block = ((mixed >> 2u) & 1u) * 2u + ((pixel.y >> 2u) & 1u);
    let index = f32(within) + (f32(block) + 0.5) / 4.0;
    let angle = GOLDEN_ANGLE * index;
    return Ray(index / 16.0, vec2f(cos(angle), sin(angle)));
}

// How often a shadow map is looked at: steps of one ray to a large light, each step that of another ray to a small one.
const LOOKS = 6;
// A ray that a light's size moves by no more texels than this needs one step.
const TEXELS_A_STEP = 4.0;
// Nothing that casts a shadow is nearer to the light than this share of its distance from where it falls; what is
// counts as there.
const NEAREST_BLOCKER = 0.7;
// A shadow map shows the upper sides of things: they are taken to reach this far down, metres. More would make the
// shadows of a raised arm dark and sharp, less would let light through thin walls.
const THICKNESS = 0.2;
// A ray is blurred by this many texels, which hides the texels' steps.
const BLUR = 1.5;

// Share of a pixel's rays that reach the light.
fn reaching(light: Light, first: Ray, point: vec3f, normal: vec3f) -> f32 {
    var layer = light.first_layer;
    var m = light.view_from_camera;
    if CUBES {
        layer += select(0u, cube_face(point - light.position), light.faces == 6u);
        m = frame.layer_from_camera[layer];
    }
    let p = (m * vec4f(point, 1.0)).xyz;
    let n = (m * vec4f(normal, 0.0)).xyz;
    let size = f32(textureDimensions(shadow_maps).x);
    // Texels a unit of x/z, and where the point falls, texels from the middle.
    let scale = 0.5 * size / light.tangent;
    let center = p.xy / p.z * scale;
    // Outside the map there is nothing that could cast a shadow.
    let in_map = p.z > 0.0 && max(abs(center.x), abs(center.y)) <= 0.5 * size;
    // Inverse depths, 1/m, are linear in x/z and y/z on a plane, and along a ray: of the point, of its plane, and of how
    // much nearer to the light something must be to cast a shadow.
    let inverse = 1.0 / p.z;
    let along = dot(n, p);
    let plane = n * select(0.0, 1.0 / along, abs(along) > 1e-5);
    let margin = (0.001 + 0.002 * p.z) * inverse * inverse;
    let thickness = THICKNESS * inverse * inverse;
    let span = inverse * (1.0 / NEAREST_BLOCKER - 1.0);
    let depths = light.inverse_near - light.inverse_far;
    let last = vec2i(i32(size) - 1);
    // Texels that the light's size moves a ray by.
    let spread = light.radius * span * scale;
    let needed = i32(ceil(min(spread / TEXELS_A_STEP, 4.0)));
    let steps = select(max(needed, 1), LOOKS, needed > 3);
    let rays = f32(LOOKS / steps);
    // The rays to a small light are the same for all pixels: where a half-shadow is not much wider than the pixels that
    // are put together, its edge would waver.
    var share = select(first.share, 0.5 / rays, rays > 1.0);
    var direction = select(first.direction, vec2f(1.0, 0.0), rays > 1.0);
    var blocked = 0.0;
    var free = 1.0;
    var low = 0.0;
    var step = 0;
    // Not left early: a software adapter walks through what a pixel does not need.
    for (var i = 0; i < select(0, LOOKS, in_map); i++) {
        // Short steps where things stand on the surface.
        let end = f32(step + 1) / f32(steps);
        let now = (f32(step) + fract(0.5 + share * 7.0 + f32(step) * 0.618)) / f32(steps);
        let high = select(span * end * end, 1e9, step == steps - 1);
        let at = floor(center + direction * (sqrt(share) * (spread * now * now + BLUR)));
        let texel = clamp(vec2i(vec2f(at.x, -1.0 - at.y) + 0.5 * size), vec2i(0), last);
        let blocker = light.inverse_near - depths * textureLoad(shadow_maps, texel, layer, 0);
        // Against the plane of the surface where the texel sees it, so that no surface shadows itself.
        let surface = clamp(dot(plane, vec3f((at + 0.5) / scale, 1.0)), 0.8 * inverse, 1.25 * inverse);
        let above = blocker - surface - margin;
        free = select(free, 0.0, above > low && above < high + thickness);
        low = high;
        step += 1;
        // The next ray: rays are spread over the disk by a spiral (Vogel 1979).
        let ends = step == steps;
        blocked += select(0.0, 1.0 - free, ends);
        free = select(free, 1.0, ends);
        low = select(low, 0.0, ends);
        share += select(0.0, 1.0 / rays, ends);
        direction = select(direction, turn(direction), ends);
        step = select(step, 0, ends);
    }
    return 1.0 - blocked / rays;
}

@fragment
fn fs_shade(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    let pixel = floor(clip.xy);
    let at = vec2i(pixel);
    let depth = textureLoad(seen_depth, at, 0).x;
    if depth <= 0.0 {
        return vec4f(1.0);
    }
    let k = frame.intrinsics;
    let point = vec3f((pixel - k.zw) / k.xy * depth, depth);
    let normal = normalize(2.0 * textureLoad(seen_normal, at, 0).xyz - 1.0);
    let first = first_ray(vec2u(at));
    var shares = vec4f(1.0);
    // No loop, see light.wgsl.
    if LIGHT_COUNT > 0u {
        shares.x = reaching(frame.lights[0], first, point, normal);
    }
    if LIGHT_COUNT > 1u {
        shares.y = reaching(frame.lights[1], first, point, normal);
    }
    if LIGHT_COUNT > 2u {
        shares.z = reaching(frame.lights[2], first, point, normal);
    }
    if LIGHT_COUNT > 3u {
        shares.w = reaching(frame.lights[3], first, point, normal);
    }
    return shares;
}
