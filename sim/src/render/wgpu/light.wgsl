// Shades the images of geometry.wgsl: luminance of every pixel, each lit once however small its triangle.
// Everything is in the camera's optical frame: x right, y down, z forward, metres.
// The formulas are those of shading.rs, line by line.

// How many lights there are, and whether any of their shadow maps is a cube.
override LIGHT_COUNT: u32 = 4;
override CUBES: bool = true;

// Largest finite value of the half-float colour target, with room for sums.
const MAX_LUMINANCE = 60000.0;

@group(0) @binding(1) var shadow_maps: texture_depth_2d_array;
@group(1) @binding(0) var seen_depth: texture_2d<f32>;
@group(1) @binding(1) var seen_albedo: texture_2d<f32>;
@group(1) @binding(2) var seen_normal: texture_2d<f32>;
// See prepare.wgsl.
@group(1) @binding(3) var prepared: texture_2d<f32>;

// Ambient light from below at a point: the floor's, and the table's as a disk that faces it.
fn below_of(point: vec3f) -> vec3f {
    let offset = point - frame.bounce_center;
    let squared = frame.bounce_radius * frame.bounce_radius;
    let share = select(0.0, squared / (squared + dot(offset, offset)), dot(offset, frame.up) > frame.bounce_lowest);
    return frame.ground + frame.bounce_lux * share;
}

fn ambient_on(below: vec3f, normal: vec3f) -> vec3f {
    return mix(below, frame.sky, 0.5 + 0.5 * dot(normal, frame.up));
}

fn schlick(at_normal: vec3f, cos_angle: f32) -> vec3f {
    let m = 1.0 - cos_angle;
    return at_normal + (1.0 - at_normal) * (m * m * m * m * m);
}

fn ggx(roughness: f32, n_h_raw: f32, n_l: f32, n_v: f32) -> f32 {
    let alpha = roughness * roughness;
    let a2 = alpha * alpha;
    let n_h = clamp(n_h_raw, 0.0, 1.0);
    let d = n_h * n_h * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * d * d);
    let shadow_v = n_l * sqrt(n_v * n_v * (1.0 - a2) + a2);
    let shadow_l = n_v * sqrt(n_l * n_l * (1.0 - a2) + a2);
    return distribution * 0.5 / max(shadow_v + shadow_l, 1e-6);
}

fn ambient_gloss(specular: vec3f, roughness: f32, n_v: f32) -> vec3f {
    let r = vec4f(
        1.0 - roughness,
        0.0425 - 0.0275 * roughness,
        1.04 - 0.572 * roughness,
        0.022 * roughness - 0.04,
    );
    let a = min(r.x * r.x, exp2(-9.28 * n_v)) * r.x + r.y;
    return specular * (r.z - 1.04 * a) + (r.w + 1.04 * a);
}

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

const SEARCH_TAPS = 6;
const SHADOW_TAPS = 10;
// Nothing that casts a shadow stands farther from where it falls than this share of the light's distance.
const NEAREST_BLOCKER = 0.7;

// A surface as one view of a shadow map sees it.
struct Receiver {
    layer: u32,
    // Side of the map, texels, and texels a unit of x/z.
    size: f32,
    scale: f32,
    // Where the point falls, texels from the middle.
    center: vec2f,
    // Its inverse depth, and that of its plane at (x/z, y/z): linear in both.
    inverse: f32,
    plane: vec3f,
    // How much nearer something must be to cast a shadow, 1/m.
    margin: f32,
}

// Inverse depth of what the shadow map shows `step` texels from the receiver, or 0 where that does not shade it. Each
// comparison is against the plane of the surface where the tap's texel sees it, so that no surface shadows itself however
// wide the kernel.
fn blocker_at(light: Light, receiver: Receiver, step: vec2f) -> f32 {
    let at = floor(receiver.center + step);
    let tap = (at + 0.5) / receiver.scale;
    let last = vec2i(i32(receiver.size) - 1);
    let texel = clamp(vec2i(vec2f(at.x, -1.0 - at.y) + 0.5 * receiver.size), vec2i(0), last);
    let span = light.inverse_near - light.inverse_far;
    let blocker = light.inverse_near - span * textureLoad(shadow_maps, texel, receiver.layer, 0);
    let surface = dot(receiver.plane, vec3f(tap, 1.0));
    let limited = clamp(surface, 0.8 * receiver.inverse, 1.25 * receiver.inverse);
    return select(0.0, blocker, blocker > limited + receiver.margin);
}

// Share of an area light that arrives (percentage-closer soft shadows, Fernando 2005).
fn lit(light: Light, spiral: vec2f, point: vec3f, normal: vec3f) -> f32 {
    var layer = light.first_layer;
    var m = light.view_from_camera;
    if CUBES {
        layer += select(0u, cube_face(point - light.position), light.faces == 6u);
        m = frame.layer_from_camera[layer];
    }
    let p = (m * vec4f(point, 1.0)).xyz;
    let n = (m * vec4f(normal, 0.0)).xyz;
    let size = f32(textureDimensions(shadow_maps).x);
    let scale = 0.5 * size / light.tangent;
    let center = p.xy / p.z * scale;
    // Outside the map there is nothing that could cast a shadow.
    if !(p.z > 0.0 && max(abs(center.x), abs(center.y)) <= 0.5 * size) {
        return 1.0;
    }
    let inverse = 1.0 / p.z;
    let along = dot(n, p);
    let plane = n * select(0.0, 1.0 / along, abs(along) > 1e-5);
    let margin = (0.001 + 0.002 * p.z) * inverse * inverse;
    let receiver = Receiver(layer, size, scale, center, inverse, plane, margin);

    // Where the half-shadow of the farthest possible blocker ends, texels.
    let farthest = light.radius * (1.0 - NEAREST_BLOCKER) / (NEAREST_BLOCKER * p.z) * scale;
    let search = max(farthest, 1.5);
    var direction = spiral;
    var blockers = 0.0;
    var blocker_sum = 0.0;
    for (var i = 0; i < SEARCH_TAPS; i++) {
        let blocker = blocker_at(light, receiver, direction * (search * sqrt((f32(i) + 0.5) / f32(SEARCH_TAPS))));
        direction = turn(direction);
        blockers += select(0.0, 1.0, blocker > 0.0);
        blocker_sum += blocker;
    }
    // Not an early return: software adapters walk through what a pixel does not need, but not through loops that none of
    // a block of pixels needs.
    let taps = select(SHADOW_TAPS, 0, blockers == 0.0);
    let width = light.radius * max(blocker_sum / max(blockers, 1.0) - inverse, 0.0) * scale;
    let radius = max(min(width, search), 1.2);
    var shaded = 0.0;
    for (var i = 0; i < taps; i++) {
        let blocker = blocker_at(light, receiver, direction * (radius * sqrt((f32(i) + 0.5) / f32(SHADOW_TAPS))));
        direction = turn(direction);
        shaded += select(0.0, 1.0, blocker > 0.0);
    }
    return 1.0 - shaded / f32(SHADOW_TAPS);
}

struct Surface {
    point: vec3f,
    normal: vec3f,
    // Unit vector to the camera, and its cosine with the normal.
    seen: vec3f,
    n_v: f32,
    // Reflectance at normal incidence, and of the body beneath.
    specular: vec3f,
    diffuse: vec3f,
    roughness: f32,
}

// Luminance of a surface in one light.
fn reflected(light: Light, surface: Surface, spiral: vec2f) -> vec3f {
    let difference = light.position - surface.point;
    let squared = max(dot(difference, difference), 1e-4);
    let distance = sqrt(squared);
    let to_light = difference / distance;
    let s = clamp(
        (-dot(to_light, light.axis) - light.cos_outer) / max(light.cos_inner - light.cos_outer, 1e-4),
        0.0,
        1.0,
    );
    let beam = s * s * (3.0 - 2.0 * s);
    let n_l = dot(surface.normal, to_light);
    if beam <= 0.0 || n_l <= 0.0 {
        return vec3f(0.0);
    }
    let share = lit(light, spiral, surface.point, surface.normal);
    let illuminance = light.intensity * (beam / squared);
    let halfway = normalize(to_light + surface.seen);
    let fresnel = schlick(surface.specular, max(dot(surface.seen, halfway), 0.0));
    let roughness = surface.roughness;
    let widened = sqrt(min(roughness * roughness + 0.5 * light.radius / max(distance, 0.01), 1.0));
    let gloss = fresnel * ggx(widened, dot(surface.normal, halfway), n_l, surface.n_v);
    return (surface.diffuse * (1.0 - fresnel) + gloss) * illuminance * (n_l * share);
}

@fragment
fn fs_light(@builtin(position) clip: vec4f) -> @location(0) vec4f {
    let pixel = floor(clip.xy);
    let at = vec2i(pixel);
    let depth = textureLoad(seen_depth, at, 0).x;
    if depth <= 0.0 {
        return vec4f(frame.background, 1.0);
    }
    let k = frame.intrinsics;
    let point = vec3f((pixel - k.zw) / k.xy * depth, depth);
    let coded = textureLoad(seen_albedo, at, 0);
    let albedo = coded.rgb * coded.rgb;
    let roughness = coded.a;
    let turned = textureLoad(seen_normal, at, 0);
    let normal = normalize(2.0 * turned.xyz - 1.0);
    let metallic = turned.a;
    let seen = -normalize(point);
    let n_v = max(dot(normal, seen), 1e-3);
    let specular = mix(vec3f(0.04), albedo, metallic);
    let diffuse = albedo * ((1.0 - metallic) / PI);
    let angle = rotation(pixel);
    let spiral = vec2f(cos(angle), sin(angle));

    let mirror = normal * (2.0 * dot(normal, seen)) - seen;
    let below = below_of(point);
    var radiance = (diffuse * ambient_on(below, normal)
        + ambient_gloss(specular, roughness, n_v) * ambient_on(below, mirror) / PI)
        * textureLoad(prepared, at, 0).x;

    // No loop: an index that is known beforehand spares a software adapter to gather each value lane by lane.
    let surface = Surface(point, normal, seen, n_v, specular, diffuse, roughness);
    if LIGHT_COUNT > 0u {
        radiance += reflected(frame.lights[0], surface, spiral);
    }
    if LIGHT_COUNT > 1u {
        radiance += reflected(frame.lights[1], surface, spiral);
    }
    if LIGHT_COUNT > 2u {
        radiance += reflected(frame.lights[2], surface, spiral);
    }
    if LIGHT_COUNT > 3u {
        radiance += reflected(frame.lights[3], surface, spiral);
    }
    return vec4f(clamp(radiance, vec3f(0.0), vec3f(MAX_LUMINANCE)), 1.0);
}
