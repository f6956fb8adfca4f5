// The view and its light, all in the camera's optical frame. Nothing here may steer a branch or a loop on its own: Mesa's
// software driver would write such values into the program and translate it anew for each frame.

struct Light {
    position: vec3f,
    // Cosine of the cone's edge and of its hot spot's edge.
    cos_outer: f32,
    axis: vec3f,
    cos_inner: f32,
    // Candela a channel.
    intensity: vec3f,
    // Its shadow map's first layer.
    first_layer: u32,
    // 1 for one view, 6 for a cube.
    faces: u32,
    // Radius of the luminous disk, metres.
    radius: f32,
    // Half width of the shadow map at a distance of 1 m along its axis, metres.
    tangent: f32,
    // Inverse distances, 1/m, of depth 0 and depth 1 of the shadow map.
    inverse_near: f32,
    inverse_far: f32,
    // Rigid transform to the frame of its shadow map's only view, z along the view; all zeros where it has none, so that
    // nothing is in view.
    view_from_camera: mat4x4f,
}

struct Frame {
    // fx, fy, cx, cy of the pixels.
    intrinsics: vec4f,
    up: vec3f,
    padding: f32,
    // Lux a channel on a surface that faces up, and on one that faces down.
    sky: vec3f,
    padding_2: f32,
    ground: vec3f,
    bounce_radius: f32,
    bounce_center: vec3f,
    bounce_lowest: f32,
    bounce_lux: vec3f,
    // Where nothing is hit.
    background: vec3f,
    lights: array<Light, 4>,
    // The same for the views of all layers.
    layer_from_camera: array<mat4x4f, 24>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
