//! Table, bin, floor and wall as things to draw.

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::textures;
use crate::mesh::{Material, Mesh, Visual};
use crate::scene::{Fixture, FixtureKind};
use crate::shape::Convex;

/// Metres that one repeat of a texture covers.
const WOOD_M: f64 = 0.8;
const CARDBOARD_M: f64 = 0.4;
const WALL_M: f64 = 2.0;
const FLOOR_M: f64 = 1.0;
/// The floor is drawn this far in each direction, and the wall stands this far ahead, metres.
const ROOM_M: f64 = 4.0;

/// The scene's fixtures, floor and a wall behind the table, with the world pose of each mesh. `seed` varies the wood.
pub fn furniture(fixtures: &[Fixture], seed: u64) -> Vec<(Isometry3<f64>, Arc<Visual>)> {
    let wood = Arc::new(textures::wood(seed as u32));
    let cardboard = Arc::new(textures::cardboard());
    let mut drawn = Vec::new();
    for fixture in fixtures {
        let Convex::Cuboid { half } = &fixture.shape.geometry else { continue };
        let (texture, metres, roughness) = match fixture.kind {
            FixtureKind::TableTop => (Some(&wood), WOOD_M, 0.55),
            FixtureKind::Bin => (Some(&cardboard), CARDBOARD_M, 0.9),
            FixtureKind::TableLeg | FixtureKind::Stand => (None, 1.0, 0.5),
        };
        drawn.push((fixture.shape.pose, tiled(*half, texture, metres, roughness, [0.32, 0.33, 0.35])));
    }
    let slab = |half, texture: RgbImage, metres, roughness| {
        tiled(half, Some(&Arc::new(texture)), metres, roughness, [1.0; 3])
    };
    let floor = slab(Vector3::new(ROOM_M, ROOM_M, 0.01), textures::floor(seed as u32), FLOOR_M, 0.6);
    drawn.push((Isometry3::from(Translation3::new(0.5, 0.0, -0.01)), floor));
    let wall = slab(Vector3::new(0.01, ROOM_M, 1.5), textures::wall(), WALL_M, 0.95);
    drawn.push((Isometry3::from(Translation3::new(0.5 + ROOM_M, 0.0, 1.5)), wall));
    drawn
}

/// A box whose texture repeats every `metres`, in world scale on every face.
fn tiled(
    half: Vector3<f64>,
    texture: Option<&Arc<RgbImage>>,
    metres: f64,
    roughness: f32,
    plain: [f32; 3],
) -> Arc<Visual> {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        // The longer side of a face runs along the texture's width, as the grain does.
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut flip = false;
        if half[u] < half[v] {
            std::mem::swap(&mut u, &mut v);
            flip = true;
        }
        for sign in [-1.0, 1.0] {
            let mut normal = Vector3::zeros();
            normal[axis] = sign as f32;
            let first = mesh.positions.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = Vector3::zeros();
                p[axis] = sign * half[axis];
                p[u] = a * half[u];
                p[v] = b * half[v];
                mesh.positions.push(Point3::from(p.cast::<f32>()));
                mesh.normals.push(normal);
                mesh.uvs.push([((p[u] + half[u]) / metres) as f32, ((p[v] + half[v]) / metres) as f32]);
            }
            let outward = (sign > 0.0) != flip;
            let quad: [[u32; 3]; 2] = if outward { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
            mesh.triangles.extend(quad.map(|t| t.map(|i| first + i)));
        }
    }
    let material = Material {
        base_color: if texture.is_some() { [1.0; 3] } else { plain },
        roughness,
        metallic: 0.0,
        texture: texture.cloned(),
    };
    Arc::new(Visual { mesh: Arc::new(mesh), material })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_look_outwards() {
        for half in [Vector3::new(1.0, 2.0, 3.0), Vector3::new(3.0, 1.0, 2.0)] {
            let visual = tiled(half, None, 1.0, 0.5, [1.0; 3]);
            let mesh = &visual.mesh;
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let winding = (b - a).cross(&(c - a));
                assert!(winding.dot(&mesh.normals[t[0] as usize]) > 0.0);
                assert!(winding.dot(&a.coords) > 0.0);
            }
        }
    }
}
