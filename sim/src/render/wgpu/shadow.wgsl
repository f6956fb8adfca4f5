// Draws the depth of posed meshes as one light sees them.

struct View {
    shadow_from_camera: mat4x4f,
}

struct Instance {
    camera_from_mesh: mat4x4f,
    base_color: vec3f,
    roughness: f32,
    metallic: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;

@vertex
fn vs_shadow(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3f,
) -> @builtin(position) vec4f {
    return view.shadow_from_camera * (instances[instance].camera_from_mesh * vec4f(position, 1.0));
}
