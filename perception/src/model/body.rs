//! Objects as bodies: how deep two of them are in each other, or how far apart.

use nalgebra::Isometry3;
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::{TriMesh, TriMeshFlags};

use crate::hypotheses::Lod;

/// A mesh that knows its inside, and points all over it.
#[derive(Debug)]
pub(crate) struct Body {
    mesh: TriMesh,
    /// Vertices and middles of triangles, object frame.
    points: Vec<nalgebra::Point3<f32>>,
}

/// How two bodies stand to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clearance {
    /// How deep a point of one is in the other, metres; 0 where none is.
    pub depth: f32,
    /// How near a point of one is to the other, metres; 0 where one is inside.
    pub gap: f32,
}

impl Body {
    /// `None` for a mesh that parry cannot take.
    pub fn new(lod: &Lod) -> Option<Self> {
        let vertices = lod.vertices();
        let middle = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| vertices[i as usize].coords);
            nalgebra::Point3::from((a + b + c) / 3.0)
        };
        let points = vertices.iter().copied().chain(lod.triangles.iter().map(middle)).collect();
        let corners = vertices.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let mesh = TriMesh::with_flags(corners, lod.triangles.clone(), TriMeshFlags::ORIENTED).ok()?;
        Some(Self { mesh, points })
    }

    /// How this body and another stand to each other; poses are in one frame.
    pub fn clearance(&self, pose: &Isometry3<f32>, other: &Self, other_pose: &Isometry3<f32>) -> Clearance {
        let there = self.points_in(pose, other, other_pose);
        let back = other.points_in(other_pose, self, pose);
        Clearance { depth: there.depth.max(back.depth), gap: there.gap.min(back.gap) }
    }

    fn points_in(&self, pose: &Isometry3<f32>, other: &Self, other_pose: &Isometry3<f32>) -> Clearance {
        let other_from_this = other_pose.inverse() * pose;
        let mut clearance = Clearance { depth: 0.0, gap: f32::MAX };
        for point in &self.points {
            let p = other_from_this * point;
            let p = Vector::new(p.x, p.y, p.z);
            let projection = other.mesh.project_local_point(p, false);
            let distance = (projection.point - p).length();
            if projection.is_inside {
                clearance = Clearance { depth: clearance.depth.max(distance), gap: 0.0 };
            } else {
                clearance.gap = clearance.gap.min(distance);
            }
        }
        clearance
    }
}
