//! What an object is, measured: whether its mesh, its mass and the robot's gripper go together.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_manip::Planner;
use grip_perception::resting_poses;
use grip_sim::files;
use grip_sim::mesh::Mesh;
use grip_sim::objects::mass::{SolidMass, hull, solid_mass};
use grip_sim::objects::{Axis, CollisionError, ObjectModel, collision_error, measured_symmetry};
use grip_sim::robot::RobotConfig;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

/// Version of what is printed of an object.
pub const SCHEMA: &str = "grip.object-report/1";

/// Nothing that is packed is lighter than foam or heavier than gold, kg/m3.
const DENSITIES: [f64; 2] = [20.0, 20_000.0];
/// Collision pieces further off than this on average, metres, are not the object.
const POOR_PIECES: f64 = 2e-3;
/// Resting poses nearer than this about an axis of revolution are one, radians.
const SAME_LEAN: f64 = 0.05;
/// What has no resting pose with such a share is round.
const ROLLS: f64 = 0.08;
/// Rarer resting poses are not listed, but counted.
const RARE: f64 = 0.01;

/// What was measured of an object. Frames are the object's: origin in the middle of the bounding box, axes of the file.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ObjectReport<'a> {
    schema: &'static str,
    name: &'a str,
    bop_id: u32,
    #[serde(serialize_with = "files::shown")]
    mesh: &'a Path,
    /// Of the mesh.
    triangles: usize,
    /// Extents of the bounding box, metres.
    pub size_m: [f64; 3],
    /// Largest distance of two points, metres.
    pub diameter_m: f64,
    /// Where the object's origin is in the file's coordinates, metres.
    origin_in_file_m: [f64; 3],
    /// Whether the surface is closed and wound one way throughout; else volume, centre and inertia are those of the convex hull.
    pub watertight: bool,
    /// Cubic metres.
    pub volume_m3: f64,
    mass_kg: f64,
    /// Mass over volume.
    pub density_kg_m3: f64,
    friction: f64,
    /// Of uniform density, metres.
    center_of_mass_m: [f64; 3],
    /// About the centre of mass, of uniform density.
    pub inertia_kg_m2: [[f64; 3]; 3],
    /// Axis about which any turn keeps the shape to 1 % of the diameter.
    revolution: Option<Axis>,
    /// Axes about which half a turn does, beyond those of the revolution.
    half_turns: Vec<Axis>,
    /// How it comes to rest on a table, the commonest first.
    pub resting_poses: Vec<Resting>,
    /// The convex pieces that contacts are made with.
    collision: Pieces,
    /// What the planner finds.
    pub grasps: Grasps,
    /// What may go wrong.
    pub warnings: Vec<String>,
}

/// A way to lie on a table.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Resting {
    /// The direction that points down; of an object of revolution one of all those about the axis.
    down: [f64; 3],
    /// Height of the object's origin over the table, metres.
    height_m: f64,
    /// Share of all orientations that roll into it.
    pub share: f64,
}

/// The solid of physics.
#[derive(Debug, Serialize, JsonSchema)]
struct Pieces {
    count: usize,
    /// Mean distance between the surfaces of mesh and pieces, metres.
    mean_error_m: f64,
    /// Largest distance, metres.
    max_error_m: f64,
}

/// Grasps by the robot's gripper.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Grasps {
    /// How many.
    pub count: usize,
    /// Narrowest and widest of them, metres.
    widths_m: Option<[f64; 2]>,
    /// How wide the gripper opens, metres.
    opening_m: f64,
}

/// What a mesh bounds, or its hull where it is not closed, and whether it is.
fn solid(mesh: &Mesh) -> Option<(SolidMass, bool)> {
    if mesh.is_closed()
        && let Some(mass) = solid_mass(mesh)
    {
        return Some((mass, true));
    }
    Some((solid_mass(&hull(mesh)?)?, false))
}

impl<'a> ObjectReport<'a> {
    /// Measures a model, whose origin is at `origin` in its file `mesh`; grasps are those of `planner` by the gripper of `config`.
    ///
    /// # Errors
    /// When the mesh has no volume.
    pub fn new(
        model: &'a Arc<ObjectModel>,
        mesh: &'a Path,
        origin: &Vector3<f64>,
        planner: &Planner,
        config: &RobotConfig,
    ) -> Result<Self> {
        let surface = &model.visual.mesh;
        let (mass, watertight) =
            solid(surface).with_context(|| format!("{}: is flat: an object has a volume", mesh.display()))?;
        let (size, info) = (model.size(), &model.info);
        let inertia = mass.inertia_per_kg * info.mass_kg;
        let CollisionError { mean_m, max_m } = collision_error(model);
        let found = planner.grasps(model);
        let widths = || found.candidates.iter().map(|grasp| grasp.width);
        let grasps = Grasps {
            count: found.candidates.len(),
            widths_m: (!found.candidates.is_empty())
                .then(|| [widths().fold(f64::INFINITY, f64::min), widths().fold(0.0, f64::max)]),
            opening_m: config.gripper.opening,
        };
        let (revolution, half_turns) = measured_symmetry(surface, model.diameter);
        let mut report = Self {
            schema: SCHEMA,
            name: &info.name,
            bop_id: info.bop_id,
            mesh,
            triangles: surface.triangles.len(),
            size_m: size.into(),
            diameter_m: model.diameter,
            origin_in_file_m: (*origin).into(),
            watertight,
            volume_m3: mass.volume_m3,
            mass_kg: info.mass_kg,
            density_kg_m3: info.mass_kg / mass.volume_m3,
            friction: info.friction,
            center_of_mass_m: mass.center.into(),
            inertia_kg_m2: std::array::from_fn(|row| std::array::from_fn(|column| inertia[(row, column)])),
            revolution,
            half_turns,
            resting_poses: resting(surface, &mass, revolution),
            collision: Pieces { count: model.collision.len(), mean_error_m: mean_m, max_error_m: max_m },
            grasps,
            warnings: Vec::new(),
        };
        report.warn();
        Ok(report)
    }

    fn warn(&mut self) {
        let mut warnings = Vec::new();
        if !self.watertight {
            warnings.push(
                "the mesh is not watertight: volume, centre of mass and inertia are those of its convex hull, and thin walls may be \
                 filled; close it for better ones"
                    .to_owned(),
            );
        }
        let [light, heavy] = DENSITIES;
        if !(light..=heavy).contains(&self.density_kg_m3) {
            warnings.push(format!(
                "a density of {:.4} kg/m3 is none of a solid thing ({light} to {heavy}): check mass and unit",
                self.density_kg_m3
            ));
        }
        if self.grasps.count == 0 {
            let narrowest = self.size_m.iter().copied().fold(f64::INFINITY, f64::min);
            warnings.push(format!(
                "no grasp was found: its narrowest side is {:.1} mm and the gripper opens {:.1} mm",
                1e3 * narrowest,
                1e3 * self.grasps.opening_m
            ));
        }
        if self.collision.mean_error_m > POOR_PIECES {
            warnings.push(format!(
                "its collision pieces are {:.1} mm off the mesh on average: give pieces of your own (--collision)",
                1e3 * self.collision.mean_error_m
            ));
        }
        self.warnings = warnings;
    }

    /// For people.
    pub fn text(&self) -> String {
        let mm =
            |values: &[f64]| values.iter().map(|v| format!("{:.1}", 1e3 * v)).collect::<Vec<_>>().join(" x ");
        let [x, y, z] = self.origin_in_file_m.map(|v| (1e4 * v).round() / 10.0 + 0.0);
        let tensor = self.inertia_kg_m2;
        let turns =
            |axes: &[Axis]| axes.iter().map(|axis| axis.letter().to_string()).collect::<Vec<_>>().join(", ");
        let symmetry = match (self.revolution, self.half_turns.as_slice()) {
            (None, []) => "none by shape".to_owned(),
            (Some(axis), []) => format!("any turn about {}", axis.letter()),
            (Some(axis), half) => {
                format!("any turn about {}, half turns about {}", axis.letter(), turns(half))
            }
            (None, half) => format!("half turns about {}", turns(half)),
        };
        let rests = self.resting_poses.iter().filter(|pose| pose.share >= RARE).take(8).map(|pose| {
            // No minus before a zero.
            let [x, y, z] = pose.down.map(|v| (100.0 * v).round() / 100.0 + 0.0);
            format!("{:.0} % with ({x:.2}, {y:.2}, {z:.2}) down", 100.0 * pose.share)
        });
        let rests = rests.collect::<Vec<_>>().join("; ");
        let rolls = self.resting_poses.first().is_none_or(|pose| pose.share < ROLLS);
        let grasps = match self.grasps.widths_m {
            None => "none".to_owned(),
            Some([narrow, wide]) => {
                format!("{}, {:.1} to {:.1} mm wide", self.grasps.count, 1e3 * narrow, 1e3 * wide)
            }
        };
        let mut lines = vec![
            format!("{}, number {}: {}", self.name, self.bop_id, self.mesh.display()),
            format!("  size            {} mm, {:.1} mm across", mm(&self.size_m), 1e3 * self.diameter_m),
            format!("  origin          the file's ({x:.1}, {y:.1}, {z:.1}) mm"),
            format!(
                "  mesh            {} triangles, {}",
                self.triangles,
                if self.watertight { "watertight" } else { "not watertight" }
            ),
            format!(
                "  volume          {:.2} cm3{}",
                1e6 * self.volume_m3,
                if self.watertight { "" } else { " of its convex hull" }
            ),
            format!("  mass            {:.4} kg, {:.1} kg/m3", self.mass_kg, self.density_kg_m3),
            format!(
                "  inertia         {:.4e} {:.4e} {:.4e} kg m2 about x, y, z",
                tensor[0][0], tensor[1][1], tensor[2][2]
            ),
            format!("  symmetry        {symmetry}"),
            format!(
                "  comes to rest   {} ways: {}",
                self.resting_poses.len(),
                if rolls { "it rolls" } else { &rests }
            ),
            format!(
                "  solid           {} convex pieces, {:.2} mm off the mesh on average, {:.2} mm at most",
                self.collision.count,
                1e3 * self.collision.mean_error_m,
                1e3 * self.collision.max_error_m
            ),
            format!("  grasps          {grasps}; the gripper opens {:.1} mm", 1e3 * self.grasps.opening_m),
        ];
        lines.extend(self.warnings.iter().map(|warning| format!("  warning: {warning}")));
        lines.join("\n")
    }
}

/// Resting poses; those that a turn about the axis of revolution makes of each other are one.
fn resting(mesh: &Mesh, mass: &SolidMass, revolution: Option<Axis>) -> Vec<Resting> {
    let mut found: Vec<Resting> = Vec::new();
    for pose in resting_poses(mesh, &mass.center) {
        let lean =
            |down: &Vector3<f64>| revolution.map(|axis| down.dot(&axis.unit()).clamp(-1.0, 1.0).acos());
        let same = found.iter_mut().find(|known| {
            lean(&Vector3::from(known.down))
                .zip(lean(&pose.down))
                .is_some_and(|(a, b)| (a - b).abs() < SAME_LEAN)
        });
        match same {
            Some(known) => known.share += pose.share,
            None => found.push(Resting {
                down: pose.down.into_inner().into(),
                height_m: pose.height_m,
                share: pose.share,
            }),
        }
    }
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}
