// Draws posed meshes into the images that light.wgsl shades: depth, instance, angle of incidence, colour and normal.
// Everything is in the camera's optical frame: x right, y down, z forward, metres.

struct View {
    // clip = (x a + z c, -(y b + z d), near, z)
    projection: vec4f,
    near: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var base_texture: texture_2d<f32>;
@group(1) @binding(1) var base_sampler: sampler;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) point: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) color: vec3f,
    // Roughness and metallic.
    @location(4) finish: vec2f,
    @location(5) @interpolate(flat) instance: u32,
}

fn project(point: vec3f) -> vec4f {
    let p = view.projection;
    return vec4f(point.x * p.x + point.z * p.z, -(point.y * p.y + point.z * p.w), view.near, point.z);
}

@vertex
fn vs_main(
    @builtin(instance_index) index: u32,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) color: vec4f,
    // Scales the material's roughness and metallic; see Mesh::finish.
    @location(4) finish: vec2f,
) -> Varying {
    let camera_from_mesh = instances[index].camera_from_mesh;
    let point = (camera_from_mesh * vec4f(position, 1.0)).xyz;
    var out: Varying;
    out.clip = project(point);
    out.point = point;
    out.normal = (camera_from_mesh * vec4f(normal, 0.0)).xyz;
    out.uv = uv;
    out.color = color.rgb * instances[index].base_color;
    out.finish = select(vec2f(instances[index].roughness, instances[index].metallic), finish, color.a > 0.5);
    out.instance = index + 1u;
    return out;
}

// The unit normal of the triangle on the side that is seen.
fn face_normal(point: vec3f) -> vec3f {
    let across = cross(dpdx(point), dpdy(point));
    let face = select(across, -across, dot(across, point) > 0.0);
    return face / max(length(face), 1e-30);
}

// The smooth unit normal on the side that is seen, whichever way the triangle's corners go round.
fn seen_normal(in: Varying, face: vec3f) -> vec3f {
    let length = length(in.normal);
    if length < 1e-6 {
        return face;
    }
    return select(in.normal, -in.normal, dot(in.normal, face) < 0.0) / length;
}

fn surface_of(instance: u32, normal: vec3f) -> u32 {
    let xy = vec2u(round(127.5 + 127.5 * normal.xy));
    return (instance << 16u) | (xy.x << 8u) | xy.y;
}

// IEC 61966-2-1.
fn linear_of_srgb(c: vec3f) -> vec3f {
    return select(c / 12.92, pow((c + 0.055) / 1.055, vec3f(2.4)), c > vec3f(0.04045));
}

struct Geometry {
    @location(0) depth: f32,
    // Instance from 1 on in the upper half, normal (x, y) in the lower.
    @location(1) surface: u32,
    @location(2) cos_incidence: f32,
    // Square root of linear colour (dark tones need the finer steps), roughness.
    @location(3) albedo: vec4f,
    // Unit normal mapped to 0 .. 1, metallic.
    @location(4) normal: vec4f,
}

@fragment
fn fs_geometry(in: Varying) -> Geometry {
    let texel = linear_of_srgb(textureSample(base_texture, base_sampler, in.uv).rgb);
    let normal = seen_normal(in, face_normal(in.point));
    var out: Geometry;
    out.depth = in.point.z;
    out.surface = surface_of(in.instance, normal);
    out.cos_incidence = min(abs(dot(normal, normalize(in.point))), 1.0);
    out.albedo = vec4f(sqrt(in.color * texel), in.finish.x);
    out.normal = vec4f(0.5 + 0.5 * normal, in.finish.y);
    return out;
}

struct Sample {
    @builtin(position) clip: vec4f,
    // Of the triangle's first vertex.
    @location(0) @interpolate(flat, first) surface: u32,
}

@vertex
fn vs_sample(
    @builtin(instance_index) index: u32,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
) -> Sample {
    let camera_from_mesh = instances[index].camera_from_mesh;
    let point = (camera_from_mesh * vec4f(position, 1.0)).xyz;
    let face = (camera_from_mesh * vec4f(normal, 0.0)).xyz;
    return Sample(project(point), surface_of(index + 1u, select(face, -face, dot(face, point) > 0.0)));
}

// One more sample of a pixel.
@fragment
fn fs_sample(in: Sample) -> @location(0) u32 {
    return in.surface;
}
