//! Convex hulls that touch with their whole faces.
//!
//! Parry clips two faces against each other, and knows four corners of each at most. Of a hull's face with more it takes the first
//! four in a row (parry 0.31, `ConvexPolyhedron::local_support_feature`): of a bottle's base, whose corners are round, a sliver at one
//! of them. Two such slivers miss each other, and one point is left, the deepest, which leaps from one side of the base to the other:
//! what stands on it rocks for ever. Here the four are as far apart as the face allows.

use std::ops::Range;

use rapier3d::parry::bounding_volume::{Aabb, BoundingSphere};
use rapier3d::parry::mass_properties::MassProperties;
use rapier3d::parry::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use rapier3d::parry::shape::{
    ConvexPolyhedron, FeatureId, PackedFeatureId, PolygonalFeature, PolygonalFeatureMap, Shape, ShapeType,
    SubShapeId, SupportMap, TypedShape,
};
use rapier3d::prelude::{Pose, Real, SharedShape, Vector};

/// The same solid, but of a hull with [`Hull`]'s corners.
pub(crate) fn whole_faces(solid: SharedShape) -> SharedShape {
    match solid.as_convex_polyhedron() {
        Some(hull) if hull.faces().iter().any(|face| face.num_vertices_or_edges > CORNERS) => {
            SharedShape::new(Hull(hull.clone()))
        }
        _ => solid,
    }
}

/// Corners that parry knows of a face.
const CORNERS: u32 = 4;

/// A convex hull with a face of more than four corners.
#[derive(Clone)]
struct Hull(ConvexPolyhedron);

impl Hull {
    /// Gives a feature that is a face with too many corners four others of that face: the one nearest to `hint`, the one farthest from
    /// that, and of each side between them the one that is farthest out.
    fn spread(&self, hint: Vector, feature: &mut PolygonalFeature) {
        let FeatureId::Face(face) = feature.fid.unpack() else { return };
        let face = &self.0.faces()[face as usize];
        if face.num_vertices_or_edges <= CORNERS {
            return;
        }
        let (first, count) = (face.first_vertex_or_edge as usize, face.num_vertices_or_edges as usize);
        let vertices = &self.0.vertices_adj_to_face()[first..first + count];
        let edges = &self.0.edges_adj_to_face()[first..first + count];
        let corner = |k: usize| self.0.points()[vertices[k % count] as usize];
        // Of some that follow each other around the face, the one with the largest measure.
        let most = |of: Range<usize>, measure: &dyn Fn(Vector) -> Real| {
            of.max_by(|a, b| measure(corner(*a)).total_cmp(&measure(corner(*b))))
        };
        let near = most(0..count, &|p| -(p - hint).length_squared());
        let Some(near) = near else { return };
        let all = near + 1..near + count;
        let Some(far) = most(all.clone(), &|p| (p - corner(near)).length_squared()) else { return };
        let across = corner(far) - corner(near);
        let out = |p: Vector| (p - corner(near)).cross(across).length_squared();
        let sides = [most(all.start..far, &out), most(far + 1..all.end, &out)];
        let chosen = [Some(near), sides[0], Some(far), sides[1]];
        feature.num_vertices = 0;
        for k in chosen.into_iter().flatten() {
            let n = feature.num_vertices;
            feature.vertices[n] = corner(k);
            feature.vids[n] = PackedFeatureId::vertex(vertices[k % count]);
            // The edge that follows it stands for the line to the next one: a number by which a point is known again.
            feature.eids[n] = PackedFeatureId::edge(edges[k % count]);
            feature.num_vertices += 1;
        }
    }
}

impl SupportMap for Hull {
    fn local_support_point(&self, dir: Vector) -> Vector {
        self.0.local_support_point(dir)
    }
}

impl PolygonalFeatureMap for Hull {
    fn local_support_feature(&self, dir: Vector, feature: &mut PolygonalFeature) {
        self.local_support_feature_toward(dir, self.0.local_support_point(dir), feature);
    }

    fn local_support_feature_toward(&self, dir: Vector, hint: Vector, feature: &mut PolygonalFeature) {
        self.0.local_support_feature(dir, feature);
        self.spread(hint, feature);
    }

    fn is_convex_polyhedron(&self) -> bool {
        true
    }
}

impl RayCast for Hull {
    fn cast_local_ray_and_get_normal(&self, ray: &Ray, most: Real, solid: bool) -> Option<RayIntersection> {
        self.0.cast_local_ray_and_get_normal(ray, most, solid)
    }
}

impl PointQuery for Hull {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        self.0.project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        self.0.project_local_point_and_get_feature(point)
    }
}

impl Shape for Hull {
    fn compute_local_aabb(&self) -> Aabb {
        self.0.compute_local_aabb()
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.0.compute_local_bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vector, _: u32) -> Option<Box<dyn Shape>> {
        Some(Box::new(Self(self.0.clone().scaled(scale)?)))
    }

    fn compute_aabb(&self, position: &Pose) -> Aabb {
        self.0.compute_aabb(position)
    }

    fn mass_properties(&self, density: Real) -> MassProperties {
        self.0.mass_properties(density)
    }

    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }

    fn ccd_thickness(&self) -> Real {
        self.0.ccd_thickness()
    }

    fn ccd_angular_thickness(&self) -> Real {
        self.0.ccd_angular_thickness()
    }

    fn is_convex(&self) -> bool {
        true
    }

    fn as_support_map(&self) -> Option<&dyn SupportMap> {
        Some(self)
    }

    fn as_polygonal_feature_map(&self) -> Option<(&dyn PolygonalFeatureMap, Real)> {
        Some((self, 0.0))
    }

    fn feature_normal_at_point(&self, _: SubShapeId, feature: FeatureId, _: Vector) -> Option<Vector> {
        self.0.feature_normal(feature)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

    /// A box of 60 x 40 x 100 mm with round upright edges.
    fn bottle() -> ConvexPolyhedron {
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        let outline = corners.iter().enumerate().flat_map(|(quarter, (x, y))| {
            (0..6).map(move |k| {
                let angle = TAU / 4.0 * (quarter as f32 + k as f32 / 5.0);
                (x * 0.022 + 0.008 * angle.cos(), y * 0.012 + 0.008 * angle.sin())
            })
        });
        let points: Vec<Vector> =
            outline.flat_map(|(x, y)| [-0.05, 0.05].map(|z| Vector::new(x, y, z))).collect();
        ConvexPolyhedron::from_convex_hull(&points).unwrap()
    }

    fn area(feature: &PolygonalFeature) -> f32 {
        let points = &feature.vertices[..feature.num_vertices];
        let fan = points.windows(2).map(|pair| (pair[0] - points[0]).cross(pair[1] - points[0]).z);
        fan.sum::<f32>().abs() / 2.0
    }

    #[test]
    fn four_corners_span_a_face_of_many() {
        let hull = bottle();
        let mut feature = PolygonalFeature::default();
        hull.local_support_feature(-Vector::Z, &mut feature);
        assert!(area(&feature) < 0.1 * 0.06 * 0.04, "parry does so by itself: {} m^2", area(&feature));
        for k in 0..12 {
            let hint = Vector::new(0.03 * (k as f32).cos(), 0.02 * (k as f32).sin(), -0.05);
            Hull(hull.clone()).local_support_feature_toward(-Vector::Z, hint, &mut feature);
            assert_eq!(feature.num_vertices, 4);
            assert!(area(&feature) > 0.75 * 0.06 * 0.04, "{k}: {} m^2", area(&feature));
            let nearest = hull.points().iter().map(|p| (*p - hint).length()).fold(f32::INFINITY, f32::min);
            assert!((feature.vertices[0] - hint).length() < nearest + 1e-6, "{k}");
        }
    }

    #[test]
    fn only_hulls_with_such_faces_are_other_shapes() {
        let is_hull = |solid: SharedShape| whole_faces(solid).as_shape::<Hull>().is_some();
        assert!(is_hull(SharedShape::new(bottle())));
        assert!(!is_hull(SharedShape::cuboid(0.1, 0.1, 0.1)));
        let corners: Vec<Vector> =
            (0..8).map(|k| Vector::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32)).collect();
        assert!(!is_hull(SharedShape::convex_hull(&corners).unwrap()));
    }
}
