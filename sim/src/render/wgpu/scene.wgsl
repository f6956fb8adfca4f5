// Draws posed meshes, once for geometry (depth, label, angle of incidence) and once for colour (luminance).
// Everything is in the camera's optical frame: x right, y down, z forward, metres.
// The shading formulas are those of shading.rs, line by line.

const PI = 3.14159265358979;
// Largest finite value of the half-float colour target, with room for the resolve.
const MAX_LUMINANCE = 60000.0;

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
    // Side of a shadow map texel at a distance of 1 m, metres.
    texel: f32,
}

struct Frame {
    // clip = (x a + z c, -(y b + z d), near, z)
    projection: vec4f,
    up: vec3f,
    // Lux on a surface that faces up.
    ambient: f32,
    near: f32,
    light_count: u32,
    ambient_from_below: f32,
    padding: u32,
    lights: array<Light, 4>,
    shadow_from_camera: array<mat4x4f, 24>,
}

struct Instance {
    camera_from_mesh: mat4x4f,
    base_color: vec3f,
    roughness: f32,
    metallic: f32,
    label: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;
@group(0) @binding(2) var shadow_maps: texture_depth_2d_array;
@group(0) @binding(3) var shadow_sampler: sampler_comparison;
@group(1) @binding(0) var base_texture: texture_2d<f32>;
@group(1) @binding(1) var base_sampler: sampler;

struct Varying {
    // Invariant: the colour pass may test against the depths that the geometry pass has left.
    @invariant @builtin(position) clip: vec4f,
    @location(0) point: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) color: vec3f,
    @location(4) @interpolate(flat) instance: u32,
}

@vertex
fn vs_main(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) color: vec4f,
) -> Varying {
    let camera_from_mesh = instances[instance].camera_from_mesh;
    let point = (camera_from_mesh * vec4f(position, 1.0)).xyz;
    let p = frame.projection;
    var out: Varying;
    out.clip = vec4f(
        point.x * p.x + point.z * p.z,
        -(point.y * p.y + point.z * p.w),
        frame.near,
        point.z,
    );
    out.point = point;
    out.normal = (camera_from_mesh * vec4f(normal, 0.0)).xyz;
    out.uv = uv;
    out.color = color.rgb;
    out.instance = instance;
    return out;
}

// The smooth unit normal on the side of the triangle that is seen, whichever way its corners go round.
fn seen_normal(in: Varying) -> vec3f {
    let across = cross(dpdx(in.point), dpdy(in.point));
    let face = select(across, -across, dot(across, in.point) > 0.0);
    let length = length(in.normal);
    if length < 1e-6 {
        return normalize(face);
    }
    return select(in.normal, -in.normal, dot(in.normal, face) < 0.0) / length;
}

struct Geometry {
    @location(0) depth: f32,
    @location(1) label: u32,
    @location(2) cos_incidence: f32,
}

@fragment
fn fs_geometry(in: Varying) -> Geometry {
    var out: Geometry;
    out.depth = in.point.z;
    out.label = instances[in.instance].label;
    out.cos_incidence = min(abs(dot(seen_normal(in), normalize(in.point))), 1.0);
    return out;
}

fn ambient_on(normal: vec3f) -> f32 {
    let above = 0.5 + 0.5 * dot(normal, frame.up);
    return frame.ambient * (frame.ambient_from_below + (1.0 - frame.ambient_from_below) * above);
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
fn cube_face(v: vec3f) -> i32 {
    let a = abs(v);
    if a.x >= a.y && a.x >= a.z {
        return select(1, 0, v.x > 0.0);
    }
    if a.y >= a.z {
        return select(3, 2, v.y > 0.0);
    }
    return select(5, 4, v.z > 0.0);
}

// Share of a light that arrives: four bilinear comparisons half a texel apart weigh 3x3 texels.
fn lit(light: Light, point: vec3f, normal: vec3f, to_light: vec3f) -> f32 {
    if light.first_layer < 0 {
        return 1.0;
    }
    // The map cannot tell points within its kernel apart; on a slope they would shadow each other, so the point is
    // looked up from a little outside its surface, the more the steeper the light falls in.
    let from_light = point - light.position;
    let texel = light.texel * length(from_light);
    let cos_angle = clamp(dot(normal, to_light), 0.0, 1.0);
    let slope = sqrt(1.0 - cos_angle * cos_angle);
    let raised = point + normal * (texel * (0.2 + 1.7 * slope)) + to_light * (0.2 * texel + 2e-4);
    var layer = light.first_layer;
    if light.faces == 6u {
        layer += cube_face(raised - light.position);
    }
    let clip = frame.shadow_from_camera[layer] * vec4f(raised, 1.0);
    let ndc = clip.xyz / clip.w;
    let uv = vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);
    // Outside the map there is nothing that could cast a shadow.
    if clip.w <= 0.0 || any(uv < vec2f(0.0)) || any(uv > vec2f(1.0)) {
        return 1.0;
    }
    let depth = clamp(ndc.z, 0.0, 1.0);
    let half = 0.5 / f32(textureDimensions(shadow_maps).x);
    var sum = 0.0;
    for (var i = 0; i < 4; i++) {
        let offset = vec2f(select(-half, half, (i & 1) == 1), select(-half, half, (i & 2) == 2));
        sum += textureSampleCompareLevel(shadow_maps, shadow_sampler, uv + offset, layer, depth);
    }
    return 0.25 * sum;
}

@fragment
fn fs_color(in: Varying) -> @location(0) vec4f {
    let instance = instances[in.instance];
    let texel = textureSample(base_texture, base_sampler, in.uv).rgb;
    let albedo = instance.base_color * in.color * texel;
    let normal = seen_normal(in);
    let view = -normalize(in.point);
    let n_v = max(dot(normal, view), 1e-3);
    let specular = mix(vec3f(0.04), albedo, instance.metallic);
    let diffuse = albedo * ((1.0 - instance.metallic) / PI);

    let mirror = normal * (2.0 * dot(normal, view)) - view;
    var radiance = diffuse * ambient_on(normal)
        + ambient_gloss(specular, instance.roughness, n_v) * (ambient_on(mirror) / PI);

    for (var i = 0u; i < frame.light_count; i++) {
        let light = frame.lights[i];
        let difference = light.position - in.point;
        let squared = max(dot(difference, difference), 1e-4);
        let to_light = difference / sqrt(squared);
        let s = clamp(
            (-dot(to_light, light.axis) - light.cos_outer) / max(light.cos_inner - light.cos_outer, 1e-4),
            0.0,
            1.0,
        );
        let beam = s * s * (3.0 - 2.0 * s);
        let n_l = dot(normal, to_light);
        if beam <= 0.0 || n_l <= 0.0 {
            continue;
        }
        let share = lit(light, in.point, normal, to_light);
        let illuminance = light.intensity * (beam / squared);
        let halfway = normalize(to_light + view);
        let fresnel = schlick(specular, max(dot(view, halfway), 0.0));
        let gloss = fresnel * ggx(instance.roughness, dot(normal, halfway), n_l, n_v);
        radiance += (diffuse * (1.0 - fresnel) + gloss) * illuminance * (n_l * share);
    }
    return vec4f(clamp(radiance, vec3f(0.0), vec3f(MAX_LUMINANCE)), 1.0);
}
