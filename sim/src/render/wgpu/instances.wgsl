// The posed meshes.

struct Instance {
    camera_from_mesh: mat4x4f,
    base_color: vec3f,
    roughness: f32,
    metallic: f32,
}

@group(0) @binding(1) var<storage, read> instances: array<Instance>;
