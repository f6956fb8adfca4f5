//! An object as the filters need it: levels of detail, extreme points, resting orientations, symmetries.

use std::sync::{Arc, OnceLock};

use grip_sim::mesh::Visual;
use grip_sim::objects::ObjectModel;
use nalgebra::{Isometry3, Vector3};

use super::body::Body;
use super::print::Print;
use super::resting::{Resting, resting_orientations};
use crate::error::{Error, Result};
use crate::hull::extreme_points;
use crate::hypotheses::{Lod, simplify, weld};
use crate::symmetry::{SymmetryGroup, near_symmetries, oriented_box};

/// Directions in which extreme points are taken, for the hull and for quick bounds.
const HULL_DIRECTIONS: usize = 96;
const OUTLINE_DIRECTIONS: usize = 20;

/// Triangles of the mesh of which bodies are made.
const BODY_TRIANGLES: usize = 200;

/// All that the filter needs to know of an object.
#[derive(Debug)]
pub(crate) struct Model {
    pub name: String,
    /// By number of triangles asked for, ascending.
    lods: Vec<(usize, Arc<Lod>)>,
    /// Extreme points: their hull is nearly the convex hull of the mesh.
    pub hull: Vec<Vector3<f32>>,
    /// A few extreme points, for quick bounds.
    pub outline: Vec<Vector3<f32>>,
    /// Half of the diameter, metres.
    pub radius: f32,
    /// The smallest box around it: origin in its middle, axes along its sides, in the object's frame.
    pub oriented_box: Isometry3<f32>,
    /// Orientations in which it rests on a plane.
    pub resting: Vec<Resting>,
    visual: Arc<Visual>,
    // Made when first asked for.
    body: OnceLock<Option<Body>>,
    print: OnceLock<Option<Print>>,
    symmetry: OnceLock<SymmetryGroup>,
    near_symmetries: OnceLock<Vec<Isometry3<f32>>>,
}

impl Model {
    /// Prepares an object's mesh at each of the given numbers of triangles.
    pub fn new(object: &ObjectModel, triangle_counts: &[usize]) -> Result<Self> {
        let name = object.info.name.clone();
        let fail = |message: &str| Error::Object { object: name.clone(), message: message.to_owned() };
        let mesh = &object.visual.mesh;
        let (positions, triangles) = weld(&mesh.positions, &mesh.triangles).ok_or_else(|| {
            fail("a triangle names a vertex that the mesh does not have; check the model file")
        })?;
        if positions.iter().flatten().any(|x| !x.is_finite()) {
            return Err(fail("a vertex is not finite; check the model file"));
        }
        if triangles.is_empty() {
            return Err(fail("the mesh has no triangles; load a model with a surface"));
        }
        let mut counts = triangle_counts.to_vec();
        counts.sort_unstable();
        counts.dedup();
        let simple = simplify(&positions, &triangles, &counts).into_iter().map(Arc::new);
        let lods = counts.into_iter().zip(simple).collect();
        let points: Vec<Vector3<f32>> = positions.iter().map(|p| Vector3::from(*p)).collect();
        let hull = extreme_points(&points, HULL_DIRECTIONS);
        let outline = extreme_points(&hull, OUTLINE_DIRECTIONS);
        let radius = hull.iter().fold(0.0f32, |r, p| r.max(p.norm()));
        if !(1e-3..10.0).contains(&radius) {
            return Err(fail(&format!(
                "the mesh reaches {radius} m from its origin; models must be in metres, between 1 mm and 10 m"
            )));
        }
        let oriented_box = oriented_box(&hull);
        let centroid = volume_centroid(&positions, &triangles);
        let resting = resting_orientations(&hull, centroid);
        Ok(Self {
            name,
            lods,
            hull,
            outline,
            radius,
            oriented_box,
            resting,
            visual: object.visual.clone(),
            body: OnceLock::new(),
            print: OnceLock::new(),
            symmetry: OnceLock::new(),
            near_symmetries: OnceLock::new(),
        })
    }

    /// It as a body; `None` for a mesh that makes none.
    pub fn body(&self) -> Option<&Body> {
        self.body.get_or_init(|| Body::new(self.lod(BODY_TRIANGLES))).as_ref()
    }

    /// What is printed on it, if anything.
    pub fn print(&self) -> Option<&Print> {
        self.print.get_or_init(|| Print::new(&self.visual)).as_ref()
    }

    /// The rotations that keep its convex hull, which depth may not notice.
    pub fn symmetry(&self) -> &SymmetryGroup {
        self.symmetry.get_or_init(|| SymmetryGroup::new(&self.hull, &self.oriented_box, self.radius))
    }

    /// The motions after which it nearly lies on itself, in the object's frame.
    pub fn near_symmetries(&self) -> &[Isometry3<f32>] {
        let revolution = || self.symmetry().revolution.map(|axis| axis.into_inner());
        self.near_symmetries
            .get_or_init(|| near_symmetries(&self.visual.mesh, &self.oriented_box, self.radius, revolution()))
    }

    /// The coarsest mesh of at least `triangles`.
    pub fn lod(&self, triangles: usize) -> &Arc<Lod> {
        let found = self.lods.iter().find(|(count, _)| *count >= triangles);
        &found.unwrap_or(&self.lods[self.lods.len() - 1]).1
    }
}

/// Centroid of the enclosed volume; of the box when the mesh encloses none.
fn volume_centroid(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Vector3<f32> {
    let (mut sum, mut volume) = (Vector3::zeros(), 0.0f64);
    for f in faces {
        let [a, b, c] = f.map(|i| Vector3::from(positions[i as usize]).cast::<f64>());
        let v = a.dot(&b.cross(&c));
        volume += v;
        sum += (a + b + c) * (v / 4.0);
    }
    let centroid = sum / volume;
    let reach = positions.iter().flatten().fold(0.0f32, |r, x| r.max(x.abs()));
    if centroid.iter().all(|x| x.is_finite() && x.abs() < f64::from(reach)) {
        centroid.cast()
    } else {
        Vector3::zeros()
    }
}

/// The random stream of object `index`: two of the same kind draw from two streams, or they would be the same search.
pub(crate) fn stream(estimator: &str, models: &[Arc<Model>], index: usize) -> String {
    let name = &models[index].name;
    let before = models[..index].iter().filter(|m| m.name == *name).count();
    format!("{estimator}/{name}/{before}")
}
