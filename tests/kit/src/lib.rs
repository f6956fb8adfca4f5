//! What tests and benches of all crates share: objects whose shape is known in closed form, cameras that look at them, and
//! frames of them. Plain functions; everything that is random takes its random numbers from the caller.
//!
//! | module | what it makes |
//! |---|---|
//! | [`meshes`] | boxes, cans, spheres, mugs, cups: a surface and no more |
//! | [`textured`] | boxes, cylinders and spheres with normals and texture coordinates, and a table of them for pictures |
//! | [`objects`] | object models from meshes |
//! | [`cameras`] | poses of cameras |
//! | [`frames`] | depth images and whole frames, perfect and as a sensor reads them |
//! | [`data`] | data that lies outside of the repository |
#![allow(clippy::unwrap_used, reason = "for tests alone")]

pub mod cameras;
pub mod data;
pub mod frames;
pub mod meshes;
pub mod objects;
pub mod textured;
