// Shades the images of geometry.wgsl: luminance of every pixel, each lit once however small its triangle.
// Everything is in the camera's optical frame: x right, y down, z forward, metres.
// The formulas are those of shading.rs, line by line.

// How many lights there are.
override LIGHT_COUNT: u32 = 4;

// Largest finite value of the half-float colour target, with room for sums.
const MAX_LUMINANCE = 60000.0;

@group(1) @binding(0) var seen_depth: texture_2d<f32>;
@group(1) @binding(1) var seen_albedo: texture_2d<f32>;
@group(1) @binding(2) var seen_normal: texture_2d<f32>;
// See prepare.wgsl.
@group(1) @binding(3) var prepared: texture_2d<f32>;
// See shade.wgsl.
@group(1) @binding(4) var shares: texture_2d<f32>;

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

// Luminance of a surface in one light, of which `share` arrives.
fn reflected(light: Light, surface: Surface, share: f32) -> vec3f {
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

    let mirror = normal * (2.0 * dot(normal, seen)) - seen;
    let below = below_of(point);
    var radiance = (diffuse * ambient_on(below, normal)
        + ambient_gloss(specular, roughness, n_v) * ambient_on(below, mirror) / PI)
        * textureLoad(prepared, at, 0).x;

    // No loop: an index that is known beforehand spares a software adapter to gather each value lane by lane.
    let surface = Surface(point, normal, seen, n_v, specular, diffuse, roughness);
    let arrives = textureLoad(shares, at, 0);
    if LIGHT_COUNT > 0u {
        radiance += reflected(frame.lights[0], surface, arrives[0]);
    }
    if LIGHT_COUNT > 1u {
        radiance += reflected(frame.lights[1], surface, arrives[1]);
    }
    if LIGHT_COUNT > 2u {
        radiance += reflected(frame.lights[2], surface, arrives[2]);
    }
    if LIGHT_COUNT > 3u {
        radiance += reflected(frame.lights[3], surface, arrives[3]);
    }
    return vec4f(clamp(radiance, vec3f(0.0), vec3f(MAX_LUMINANCE)), 1.0);
}
