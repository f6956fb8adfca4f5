//! One object alone as a depth image, as large as it needs to be.

use nalgebra::Point3;

use super::NEAR;
use super::silhouette::cover;
use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image};
use crate::mesh::Mesh;
use crate::pose::{Camera, Object, Pose};

/// Depth of a single object: the part of a picture that holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectDepth {
    /// Depth along the axis of its nearest surface, metres; 0.0 where it covers nothing. Without any pixel where all of the
    /// object is outside of the image.
    pub depth: DepthImage,
    /// Pixel of the whole picture at the first column and row.
    pub offset: [usize; 2],
}

impl ObjectDepth {
    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.depth.width(), self.depth.height()]
    }

    /// At column `u`, row `v` of the whole picture, metres; 0.0 where the object is not.
    pub fn at(&self, u: usize, v: usize) -> f32 {
        let inside = |value: usize, axis: usize| {
            value.checked_sub(self.offset[axis]).filter(|&value| value < self.size()[axis])
        };
        inside(u, 0).zip(inside(v, 1)).map_or(0.0, |(u, v)| *self.depth.at(u, v))
    }
}

/// Draws the depth of a mesh, whichever way its triangles go round. A pixel is covered when the ray through its centre
/// meets a triangle beyond [`NEAR`], as for the ray caster.
pub fn object_depth(
    mesh: &Mesh,
    camera_from_object: &Pose<Camera, Object>,
    intrinsics: &Intrinsics,
) -> ObjectDepth {
    let points: Vec<Point3<f64>> =
        mesh.positions.iter().map(|p| camera_from_object.transform_point(&p.cast())).collect();
    let Some([columns, rows]) = bounds(&points, intrinsics) else {
        return ObjectDepth { depth: Image::filled(0, 0, 0.0), offset: [0; 2] };
    };
    let mut inverse = Image::filled(columns.len(), rows.len(), 0.0);
    for triangle in &mesh.triangles {
        let mut corners = [[0.0; 3]; 4];
        let count = in_front(triangle.map(|i| points[i as usize]), |index, p| {
            corners[index] = [
                intrinsics.fx * p.x / p.z + intrinsics.cx - columns.start as f64,
                intrinsics.fy * p.y / p.z + intrinsics.cy - rows.start as f64,
                1.0 / p.z,
            ];
        });
        for last in 2..count {
            cover(&mut inverse, [corners[0], corners[last - 1], corners[last]]);
        }
    }
    inverse.data_mut().iter_mut().filter(|w| **w > 0.0).for_each(|w| *w = 1.0 / *w);
    ObjectDepth { depth: inverse, offset: [columns.start, rows.start] }
}

/// The columns and rows of the image that the points can cover; `None` where these are none.
fn bounds(points: &[Point3<f64>], intrinsics: &Intrinsics) -> Option<[std::ops::Range<usize>; 2]> {
    let size = [intrinsics.width, intrinsics.height];
    if points.iter().any(|p| p.coords.iter().any(|x| !x.is_finite())) {
        return None;
    }
    let behind = points.iter().filter(|p| p.z <= NEAR).count();
    if behind == points.len() {
        return None;
    }
    if behind > 0 {
        // Where a surface passes the camera, its picture has no bounds.
        return Some(size.map(|size| 0..size));
    }
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for seen in points.iter().filter_map(|p| intrinsics.project(p)) {
        for axis in 0..2 {
            low[axis] = low[axis].min(seen[axis]);
            high[axis] = high[axis].max(seen[axis]);
        }
    }
    let range = |axis: usize| {
        let (first, end) = (low[axis].ceil().max(0.0), (high[axis].floor() + 1.0).min(size[axis] as f64));
        (first < end).then_some(first as usize..end as usize)
    };
    Some([range(0)?, range(1)?])
}

/// Gives the corners of what is left of a triangle beyond the near plane, with their numbers, and tells how many these are: 0, 3
/// or 4.
fn in_front(corners: [Point3<f64>; 3], mut give: impl FnMut(usize, Point3<f64>)) -> usize {
    let mut count = 0;
    let mut add = |p| {
        give(count, p);
        count += 1;
    };
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        if a.z > NEAR {
            add(a);
        }
        if (a.z > NEAR) != (b.z > NEAR) {
            let mut p = a + (b - a) * ((NEAR - a.z) / (b.z - a.z));
            // Rounding must not bring it to the other side.
            p.z = NEAR;
            add(p);
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::mesh::Visual;
    use crate::objects::{ObjectLibrary, ObjectSet};
    use crate::render::cpu::CpuRenderer;
    use crate::render::{Instance, Lighting, RenderScene, Renderer};

    const K: Intrinsics = Intrinsics { width: 160, height: 120, fx: 140.0, fy: 140.0, cx: 79.5, cy: 59.5 };

    /// What the ray caster sees of it.
    fn cast(visual: &Arc<Visual>, pose: &Pose<Camera, Object>) -> DepthImage {
        let instances = vec![Instance { visual: visual.clone(), pose: *pose.iso(), label: 1 }];
        let scene = RenderScene { instances, bounce: None };
        let mut renderer = CpuRenderer::new().with_smooth_edges(false);
        renderer.render(&scene, &Lighting::default(), &K, &Pose::identity()).unwrap().depth
    }

    #[test]
    fn it_is_what_the_ray_caster_sees() {
        let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
        let library = ObjectLibrary::open(&table, ObjectSet::BuiltIn).unwrap();
        let poses = [
            Pose::from_xyz_rpy([0.02, -0.01, 0.5], [0.4, 1.1, -0.3]),
            // Out of the image on the left, and above.
            Pose::from_xyz_rpy([-0.27, 0.0, 0.5], [2.0, 0.3, 1.0]),
            Pose::from_xyz_rpy([0.0, -0.2, 0.45], [-1.0, 0.7, 2.0]),
            // Around the camera, and behind it.
            Pose::from_xyz_rpy([0.01, 0.02, 0.05], [0.2, 0.5, 0.1]),
            Pose::from_xyz_rpy([0.0, 0.0, -0.6], [0.2, 0.5, 0.1]),
        ];
        for name in ["003_cracker_box", "019_pitcher_base", "025_mug", "037_scissors"] {
            let visual = library.load(name).unwrap().visual.clone();
            for (i, pose) in poses.iter().enumerate() {
                let (ours, theirs) = (object_depth(&visual.mesh, pose, &K), cast(&visual, pose));
                let (mut covered, mut rims, mut other) = (0, 0, 0);
                for v in 0..K.height {
                    for u in 0..K.width {
                        let (a, b) = (ours.at(u, v), *theirs.at(u, v));
                        covered += usize::from(b > 0.0);
                        rims += usize::from((a > 0.0) != (b > 0.0));
                        other += usize::from(a > 0.0 && b > 0.0 && (a - b).abs() > 1e-4 * b);
                    }
                }
                println!("{name}, pose {i}: {covered} pixels, {rims} of one alone, {other} at another depth");
                assert_eq!(covered > 50, i < 4, "{name}, pose {i}");
                assert!(rims <= 2 + covered / 500 && other <= 2 + covered / 500, "{name}, pose {i}");
            }
        }
    }

    #[test]
    fn there_is_nothing_of_what_is_out_of_sight_or_nowhere() {
        let mesh = Mesh {
            positions: [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.1, 0.0]].map(Point3::from).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        for xyz in [[9.0, 0.0, 1.0], [0.0, 0.0, -1.0], [f64::NAN, 0.0, 1.0], [0.0, 0.0, f64::INFINITY]] {
            let seen = object_depth(&mesh, &Pose::from_xyz_rpy(xyz, [0.0; 3]), &K);
            assert_eq!((seen.size(), seen.at(80, 60)), ([0, 0], 0.0), "{xyz:?}");
        }
        let seen = object_depth(&mesh, &Pose::from_xyz_rpy([0.0, 0.0, 1.0], [0.0; 3]), &K);
        assert!((seen.at(80, 60) - 1.0).abs() < 1e-6 && seen.at(0, 0) == 0.0 && seen.at(159, 119) == 0.0);
    }
}
