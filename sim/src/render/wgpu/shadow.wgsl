// Draws the depth of posed meshes as one light sees them.

struct View {
    shadow_from_camera: mat4x4f,
}

@group(0) @binding(0) var<uniform> view: View;

@vertex
fn vs_shadow(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3f,
) -> @builtin(position) vec4f {
    return view.shadow_from_camera * (instances[instance].camera_from_mesh * vec4f(position, 1.0));
}
