//! Triangle meshes with a material: what a renderer draws and what a pose hypothesis is made of.

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Point3, Vector3};

/// An indexed triangle mesh, metres, counter-clockwise seen from outside.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<Point3<f32>>,
    /// A unit normal a vertex. Same length as `positions`.
    pub normals: Vec<Vector3<f32>>,
    /// Texture coordinates a vertex, (0, 0) at the texture's top left. Same length as `positions`, or empty.
    pub uvs: Vec<[f32; 2]>,
    /// sRGB colour a vertex. Same length as `positions`, or empty.
    pub colors: Vec<[u8; 3]>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// How a surface takes light. The surface colour is `base_color` times vertex colour times texture, those that exist.
#[derive(Debug, Clone)]
pub struct Material {
    /// sRGB, 0 to 1.
    pub base_color: [f32; 3],
    /// 0 is a mirror, 1 chalk (GGX roughness).
    pub roughness: f32,
    /// 0 for dielectrics, 1 for metal.
    pub metallic: f32,
    /// sRGB texture.
    pub texture: Option<Arc<RgbImage>>,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            base_color: [0.8, 0.8, 0.8],
            roughness: 0.7,
            metallic: 0.0,
            texture: None,
        }
    }
}

/// A mesh and its material.
#[derive(Debug, Clone)]
pub struct Visual {
    /// Geometry.
    pub mesh: Arc<Mesh>,
    /// Appearance.
    pub material: Material,
}
