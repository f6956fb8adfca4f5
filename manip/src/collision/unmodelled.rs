//! Unmodelled obstacles: depth readings that no fixture, no believed object and no link of the robot explains.
//!
//! They are obstacles like any other ([`BeliefScene::unmodelled`]): an object that the estimator missed, or one that the scene
//! does not list, is not run into.

use std::collections::BTreeMap;

use grip_sim::pose::{Base, World};
use nalgebra::{Point3, Vector3};
use parry3d::math::{Pose, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::checker::CollisionChecker;
use super::piece::Piece;
use super::query::CollisionBody;
use super::solid::{distance_from_point, pose32};
use crate::belief::BeliefScene;
use crate::ranges::Ranges;

/// Settings of [`unmodelled_obstacles`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct UnmodelledSettings {
    /// A reading this near to a believed object is one of it, metres, 0 to 0.2, beside the object's own spread. Default 0.02.
    pub object: f64,
    /// ... to a fixture. Default 0.015, beyond the noise of depth at a metre.
    pub fixture: f64,
    /// ... to the robot. Default 0.03.
    pub robot: f64,
    /// Edge of the cells that readings are gathered in, metres, 0.002 to 0.01. Default 0.01; no larger, since a cell's obstacle
    /// is a ball of 6 mm, and balls a centimetre apart leave no gap.
    pub cell: f64,
    /// Readings that a cell needs, 1 to 100 000: single ones at the edges of objects are mixtures of what is before and behind.
    /// Default 6.
    pub readings: usize,
    /// How far from the base, seen from above, anything is looked at, metres, 0.1 to 10. Default 1.3, the arm's reach.
    pub reach: f64,
    /// How high above the table anything is looked at, metres, 0.01 to 10. Default 0.5.
    pub height: f64,
}

impl Default for UnmodelledSettings {
    fn default() -> Self {
        Self { object: 0.02, fixture: 0.015, robot: 0.03, cell: 0.01, readings: 6, reach: 1.3, height: 0.5 }
    }
}

impl UnmodelledSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("object", self.object, 0.0..=0.2, "metres")
            .number("fixture", self.fixture, 0.0..=0.2, "metres")
            .number("robot", self.robot, 0.0..=0.2, "metres")
            .number("cell", self.cell, 0.002..=0.01, "metres")
            .count("readings", self.readings, 1..=100_000)
            .number("reach", self.reach, 0.1..=10.0, "metres")
            .number("height", self.height, 0.01..=10.0, "metres")
            .result()
    }
}

impl CollisionChecker {
    /// What says of a point of the base frame whether a fixture, an object or the robot at `q` is near enough to explain it.
    fn explains<'a>(
        &'a self,
        q: &[f64],
        settings: &'a UnmodelledSettings,
    ) -> impl Fn(&nalgebra::Point3<f64>) -> bool + 'a {
        let poses: Vec<Pose> = self.robot.model.fk(q).iter().map(pose32).collect();
        move |point| {
            let p = Vector::new(point.x as f32, point.y as f32, point.z as f32);
            let near = |pieces: &[Piece], p: Vector, reach: f32| {
                pieces.iter().any(|piece| {
                    piece.box_distance_squared(p) <= reach * reach
                        && distance_from_point(&piece.solid, piece.pose.inverse_transform_point(p)) <= reach
                })
            };
            let by_obstacle = self.obstacles.iter().any(|o| {
                let reach = match o.body {
                    CollisionBody::Fixture(_) => settings.fixture as f32,
                    _ => settings.object as f32 + o.spread,
                };
                o.box_distance(p) <= reach && near(&o.pieces, p, reach)
            });
            let reach = settings.robot as f32;
            by_obstacle
                || self.robot.links.iter().zip(&poses).any(|(link, pose)| {
                    let local = pose.inverse_transform_point(p);
                    (local - link.center).length() <= link.radius + reach && near(&link.pieces, local, reach)
                })
        }
    }
}

/// The mean of the unexplained readings in each cell that has enough of them and has neighbours, in a fixed order. `points` are in the
/// world, metres; the robot stands at `q` (all movable joints).
pub fn unmodelled_obstacles(
    points: impl Iterator<Item = Point3<f64>>,
    belief: &BeliefScene,
    checker: &CollisionChecker,
    q: &[f64],
    settings: &UnmodelledSettings,
) -> Vec<Point3<f64>> {
    let base_from_world: grip_sim::pose::Pose<Base, World> = belief.world_from_base.inverse();
    let (low, high) = (belief.table_height, belief.table_height + settings.height);
    let explained = checker.explains(q, settings);
    let mut cells: BTreeMap<[i32; 3], (usize, Vector3<f64>)> = BTreeMap::new();
    for point in points {
        if !(point.z > low && point.z < high) {
            continue;
        }
        let in_base = base_from_world.transform_point(&point);
        if in_base.coords.xy().norm() > settings.reach || explained(&in_base) {
            continue;
        }
        let cell = [0, 1, 2].map(|axis| (point[axis] / settings.cell).floor() as i32);
        let (count, sum) = cells.entry(cell).or_insert((0, Vector3::zeros()));
        *count += 1;
        *sum += point.coords;
    }
    cells.retain(|_, (count, _)| *count >= settings.readings);
    let neighbours = |cell: &[i32; 3]| {
        let near = (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])));
        near.filter(|d| cells.contains_key(&[cell[0] + d[0], cell[1] + d[1], cell[2] + d[2]])).count() - 1
    };
    cells
        .iter()
        .filter(|(cell, _)| neighbours(cell) >= 2)
        .map(|(_, (count, sum))| Point3::from(sum / *count as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{CollisionQuery, Margins};
    use crate::testing::{box_model, fetch, groceries, standing};
    use crate::{Planner, PlannerSettings};
    use grip_sim::pose::Gripper;

    /// Readings every 2 mm on the top of a box that stands on the table.
    fn top(x: f64, y: f64, size: [f64; 3], table: f64) -> Vec<Point3<f64>> {
        let n = size.map(|s| (s / 0.002) as i32);
        (0..n[0] * n[1])
            .map(|k| {
                let (i, j) = (f64::from(k % n[0]), f64::from(k / n[0]));
                Point3::new(x - 0.5 * size[0] + 0.002 * i, y - 0.5 * size[1] + 0.002 * j, table + size[2])
            })
            .collect()
    }

    #[test]
    fn what_is_believed_explains_its_readings_and_what_is_not_stays() {
        let mut scene = groceries();
        let (model, config) = fetch();
        let q = config.configuration(&model, "ready").unwrap();
        let planner = Planner::new(model, config, PlannerSettings::default());
        let size = [0.06, 0.06, 0.12];
        let stranger = standing(&box_model("stranger", size), 0.72, 0.30, 0.0);
        let mut readings = top(0.72, 0.30, size, scene.table_height);
        // A lone reading is no thing, and the table is known.
        readings.push(Point3::new(0.5, 0.0, scene.table_height + 0.3));
        readings.extend(top(0.6, 0.0, [0.2, 0.2, 0.003], scene.table_height));
        let find = |scene: &BeliefScene| {
            let checker = CollisionChecker::new(planner.robot().clone(), scene);
            unmodelled_obstacles(
                readings.iter().copied(),
                scene,
                &checker,
                &q,
                &UnmodelledSettings::default(),
            )
        };
        let found = find(&scene);
        assert!((30..60).contains(&found.len()), "{}", found.len());
        assert!(found.iter().all(|p| (p - Point3::new(0.72, 0.30, p.z)).norm() < 0.05));
        assert!(found.iter().all(|p| (p.z - scene.table_height - 0.12).abs() < 1e-6));

        // The hand above it meets it, and the object that explains it leaves nothing.
        scene.unmodelled = found;
        let checker = CollisionChecker::new(planner.robot().clone(), &scene);
        let down = grip_sim::pose::Pose::<World, Gripper>::from_xyz_rpy(
            [0.72, 0.30, scene.table_height + 0.14],
            [0.0, std::f64::consts::FRAC_PI_2, 0.0],
        );
        let query = CollisionQuery {
            held: None,
            allowed: &[],
            margins: Margins { world: 0.002, ..Margins::TOUCHING },
        };
        let hand = |z: f64| {
            let mut at = scene.world_from_base.iso().inverse() * down.iso();
            at.translation.vector += Vector3::z() * z;
            checker.hand_collision(&at, 0.02, &query)
        };
        assert_eq!(hand(0.0).map(|pair| pair.b), Some(CollisionBody::Unmodelled));
        assert_eq!(hand(0.1), None);
        assert!(checker.hand_clearance(down.iso(), 0.02, &query, 0.03) < 0.001);
        scene.unmodelled.clear();
        scene.objects.push(stranger);
        assert_eq!(find(&scene), []);
    }
}
