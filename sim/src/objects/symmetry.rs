//! Turns that carry an object's shape onto itself, as the table declares them.
//!
//! They are symmetries of the shape, not of the label: a can that is turned about its axis shows another side of its
//! paper. Only turns about the object frame's own axes can be declared, which is all that the 21 objects need.

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::TriMesh;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::convert;
use crate::mesh::Mesh;
use crate::rng;

/// An axis of the object frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// (1, 0, 0).
    X,
    /// (0, 1, 0).
    Y,
    /// (0, 0, 1).
    Z,
}

impl Axis {
    /// All three, in order.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The letter in files: `x`, `y` or `z`.
    pub fn letter(self) -> char {
        match self {
            Self::X => 'x',
            Self::Y => 'y',
            Self::Z => 'z',
        }
    }

    /// The axis as a unit vector of the object frame.
    pub fn unit(self) -> Unit<Vector3<f64>> {
        match self {
            Self::X => Vector3::x_axis(),
            Self::Y => Vector3::y_axis(),
            Self::Z => Vector3::z_axis(),
        }
    }

    /// The turn by `angle` radians about the axis.
    pub fn turn(self, angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&self.unit(), angle)
    }
}

/// What is wrong with a declaration, if anything: the field, its value and the reason.
pub(super) fn problem(revolution: Option<Axis>, half_turns: &[Axis]) -> Option<String> {
    for (index, axis) in half_turns.iter().enumerate() {
        let letter = axis.letter();
        if half_turns[..index].contains(axis) {
            return Some(format!("half_turns: \"{letter}\" is given twice; leave one out"));
        }
        if revolution == Some(*axis) {
            return Some(format!(
                "half_turns: \"{letter}\" is among the turns of revolution = \"{letter}\"; leave it out"
            ));
        }
    }
    match (revolution, half_turns) {
        // One of them makes the other: listed twice, a list of all symmetries would hold each turn twice.
        (Some(axis), [_, _, ..]) => Some(format!(
            "half_turns: with revolution = \"{}\" one half turn is enough; leave out the others",
            axis.letter()
        )),
        (None, [one, other]) => Some(format!(
            "half_turns: \"{}\" and \"{}\" make the third half turn; list all three",
            one.letter(),
            other.letter()
        )),
        _ => None,
    }
}

/// A turn keeps the shape if it moves no point of the surface farther off it than this share of the diameter.
const KEPT: f64 = 0.01;
/// Vertices that are looked at, of a mesh with more every so many.
const MOST_VERTICES: usize = 20_000;

/// The turns about the axes that keep a mesh's shape to 1 % of its `diameter`, as the table has them: the axis of revolution,
/// and the axes of half turns beyond it.
pub fn measured(mesh: &Mesh, diameter: f64) -> (Option<Axis>, Vec<Axis>) {
    let Some(surface) = Surface::new(mesh) else { return (None, Vec::new()) };
    let kept = |off: f64| off < KEPT * diameter;
    let mut half: Vec<Axis> =
        Axis::ALL.into_iter().filter(|axis| kept(surface.off(*axis, std::f64::consts::PI))).collect();
    // What keeps the shape at any angle keeps it at half a turn. Of a ball's three axes z is told.
    let revolution = half.iter().rev().copied().find(|axis| kept(surface.off_revolved(*axis)));
    if let Some(axis) = revolution {
        half.retain(|other| *other != axis);
        // One makes the other.
        half.truncate(1);
    } else if half.len() == 2 {
        half = Axis::ALL.to_vec();
    }
    (revolution, half)
}

/// A surface, and points all over it.
struct Surface {
    points: Vec<Point3<f64>>,
    mesh: TriMesh,
}

impl Surface {
    /// `None` for a mesh that parry cannot take.
    fn new(mesh: &Mesh) -> Option<Self> {
        let mut points = mesh.sample_surface(4000, &mut rng::stream(1, "symmetry"));
        let every = mesh.positions.len().div_ceil(MOST_VERTICES).max(1);
        points.extend(mesh.positions.iter().step_by(every).map(|p| p.cast::<f64>()));
        let corners = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        Some(Self { points, mesh: TriMesh::new(corners, mesh.triangles.clone()).ok()? })
    }

    /// How far the turned surface lies off the unturned one at most, metres. A turn and its reverse give the two
    /// sides of the Hausdorff distance, so both are tried.
    fn off(&self, axis: Axis, angle: f64) -> f64 {
        let farthest = |turn: UnitQuaternion<f64>| {
            self.points
                .par_iter()
                .map(|p| {
                    let at = convert::point(&(turn * p));
                    f64::from(self.mesh.project_local_point(at, false).point.distance(at))
                })
                .reduce(|| 0.0, f64::max)
        };
        farthest(axis.turn(angle)).max(farthest(axis.turn(-angle)))
    }

    /// The worst of turns by angles that have no common measure with the 48 or 64 sides of round models.
    fn off_revolved(&self, axis: Axis) -> f64 {
        [0.31, 0.97, 1.61, 2.23, 2.89].map(|angle| self.off(axis, angle)).into_iter().fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::objects::{ObjectInfo, ObjectLibrary, ObjectSet};

    /// A turn that is not declared moves some point farther off than this share.
    const UNDECLARED: f64 = 0.005;

    /// Whether the declaration holds the half turn about `axis`, in itself or by composition.
    fn holds(info: &ObjectInfo, axis: Axis) -> bool {
        info.half_turns.contains(&axis)
            || info.revolution == Some(axis)
            || (info.revolution.is_some() && !info.half_turns.is_empty())
    }

    #[test]
    fn declared_turns_keep_the_built_in_shapes_and_no_other_half_turn_does() {
        let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
        let library = ObjectLibrary::open(&table, ObjectSet::BuiltIn).unwrap();
        for name in library.names() {
            let model = library.load(name).unwrap();
            let surface = Surface::new(&model.visual.mesh).unwrap();
            let declared = (model.info.revolution, model.info.half_turns.clone());
            assert_eq!(measured(&model.visual.mesh, model.diameter), declared, "{name}");
            let share = |distance: f64| distance / model.diameter;
            let mut line = format!("{name:24}");
            for axis in Axis::ALL {
                let half = share(surface.off(axis, std::f64::consts::PI));
                let round = share(surface.off_revolved(axis));
                line.push_str(&format!("  {}: half {half:.4} round {round:.4}", axis.letter()));
                if holds(&model.info, axis) {
                    assert!(half < KEPT, "{name}: declared half turn about {axis:?} is off by {half}");
                } else {
                    assert!(half > UNDECLARED, "{name}: half turn about {axis:?} holds but is not declared");
                }
                if model.info.revolution == Some(axis) {
                    assert!(round < KEPT, "{name}: declared revolution about {axis:?} is off by {round}");
                } else {
                    assert!(
                        round > UNDECLARED,
                        "{name}: revolution about {axis:?} holds but is not declared"
                    );
                }
            }
            println!("{line}");
        }
    }

    #[test]
    fn declarations_are_complete_and_without_repetition() {
        use Axis::{X, Y, Z};
        for (revolution, half_turns, wanted) in [
            (None, vec![X, X], "twice"),
            (Some(Z), vec![Z], "leave it out"),
            (Some(Z), vec![X, Y], "enough"),
            (None, vec![X, Z], "all three"),
        ] {
            let message = problem(revolution, &half_turns).unwrap();
            assert!(message.starts_with("half_turns") && message.contains(wanted), "{message}");
        }
        for (revolution, half_turns) in
            [(None, vec![]), (None, vec![Z]), (None, vec![X, Y, Z]), (Some(Z), vec![X]), (Some(Z), vec![])]
        {
            assert_eq!(problem(revolution, &half_turns), None);
        }
    }
}
