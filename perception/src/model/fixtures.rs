//! Prepared models for this crate's tests.

use grip_sim::mesh::Mesh;
use grip_testkit::{meshes, objects};

use super::Model;

/// Of a mesh, with 200, 500 and 1000 triangles.
pub(crate) fn model(mesh: Mesh) -> Model {
    Model::new(&objects::object("thing", mesh), &[200, 500, 1000]).unwrap()
}

/// A box that no turn maps to itself.
pub(crate) fn skew_box(size: [f32; 3]) -> Model {
    model(meshes::skew_box(size))
}

/// A ball.
pub(crate) fn sphere(radius: f32) -> Model {
    model(meshes::sphere(radius))
}

/// A closed cylinder about z.
pub(crate) fn can(radius: f32, height: f32) -> Model {
    model(meshes::can(radius, height, 48))
}

/// A cylinder about z with a handle on the side of x.
pub(crate) fn mug(radius: f32, height: f32) -> Model {
    model(meshes::mug(radius, height))
}
