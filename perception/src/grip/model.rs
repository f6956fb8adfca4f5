//! Objects prepared for the filters: levels of detail, extreme points, resting orientations.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use grip_sim::mesh::Visual;
use grip_sim::objects::ObjectModel;
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use super::alike::alike;
use super::colour::{Looks, Turns};
use super::resting::{Resting, resting_orientations};
use super::solid::Solid;
use super::tight_box::tight_box;
use crate::error::{Error, Result};
use crate::hypotheses::{Lod, simplify, weld};

/// Directions in which extreme points are taken, for the hull and for quick bounds.
const HULL_DIRECTIONS: usize = 96;
const OUTLINE_DIRECTIONS: usize = 20;

/// Triangles of the mesh of which bodies are made.
const SOLID_TRIANGLES: usize = 200;

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
    pub tight_box: Isometry3<f32>,
    pub resting: Vec<Resting>,
    /// Made when two objects may touch.
    solid: OnceLock<Option<Solid>>,
    visual: Arc<Visual>,
    looks: OnceLock<Option<Looks>>,
    turns: OnceLock<Turns>,
    alike: OnceLock<Vec<Isometry3<f32>>>,
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
        let tight_box = tight_box(&hull);
        let centroid = volume_centroid(&positions, &triangles);
        let resting = resting_orientations(&hull, centroid);
        Ok(Self {
            name,
            lods,
            hull,
            outline,
            radius,
            tight_box,
            resting,
            visual: object.visual.clone(),
            looks: OnceLock::new(),
            turns: OnceLock::new(),
            alike: OnceLock::new(),
            solid: OnceLock::new(),
        })
    }

    /// It as a body; `None` for a mesh that makes none.
    pub fn solid(&self) -> Option<&Solid> {
        self.solid.get_or_init(|| Solid::new(self.lod(SOLID_TRIANGLES))).as_ref()
    }

    /// What is printed on it, if anything; prepared when first asked for.
    pub fn looks(&self) -> Option<&Looks> {
        self.looks.get_or_init(|| Looks::new(&self.visual)).as_ref()
    }

    /// The turns that depth may not notice; prepared when first asked for.
    pub fn turns(&self) -> &Turns {
        self.turns.get_or_init(|| Turns::new(&self.hull, &self.tight_box, self.radius))
    }

    /// Turns in which it nearly lies on itself; prepared when first asked for.
    pub fn alike(&self) -> &[Isometry3<f32>] {
        let revolution = || self.turns().revolution.map(|axis| axis.into_inner());
        self.alike.get_or_init(|| alike(&self.visual.mesh, &self.tight_box, self.radius, revolution()))
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

/// Evenly spread unit vectors (Fibonacci lattice).
pub(crate) fn directions(count: usize) -> impl Iterator<Item = Vector3<f32>> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f32 / count as f32;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (golden * i as f32).sin_cos();
        Vector3::new(r * cos, r * sin, z)
    })
}

/// The points that are farthest in some direction.
fn extreme_points(points: &[Vector3<f32>], count: usize) -> Vec<Vector3<f32>> {
    let mut kept: Vec<usize> = directions(count)
        .chain([Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::x(), -Vector3::y(), -Vector3::z()])
        .filter_map(|d| (0..points.len()).max_by(|&a, &b| points[a].dot(&d).total_cmp(&points[b].dot(&d))))
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|i| points[i]).collect()
}

/// An object, the numbers of triangles asked for, and what was made of it.
type Entry = (Arc<ObjectModel>, Vec<usize>, Arc<Model>);

/// Prepared models by object, so that a trial simplifies each mesh once.
#[derive(Debug, Default)]
pub(crate) struct ModelCache {
    entries: Mutex<Vec<Entry>>,
}

/// More objects than a session has; beyond it the oldest goes.
const CACHE_SIZE: usize = 64;

impl ModelCache {
    /// The prepared models of all `objects`, in their order.
    pub fn all(&self, objects: &[Arc<ObjectModel>], counts: &[usize]) -> Result<Vec<Arc<Model>>> {
        objects.par_iter().map(|object| self.get(object, counts)).collect()
    }

    /// The prepared model of `object`, made now if it was not before.
    fn get(&self, object: &Arc<ObjectModel>, counts: &[usize]) -> Result<Arc<Model>> {
        let lock = || self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let found =
            lock().iter().find(|(o, c, _)| Arc::ptr_eq(o, object) && c == counts).map(|(_, _, m)| m.clone());
        if let Some(model) = found {
            return Ok(model);
        }
        let model = Arc::new(Model::new(object, counts)?);
        let mut entries = lock();
        if entries.len() >= CACHE_SIZE {
            entries.remove(0);
        }
        entries.push((object.clone(), counts.to_vec(), model.clone()));
        Ok(model)
    }
}
