//! The score: the only place where truth meets belief.
//!
//! A [`Watch`] follows one attempt step by step in the physics world and fills the clauses of success; [`pose_errors`]
//! compares an estimate with where the object really is. Nothing here flows back to perception or planning.

use grip_perception::metrics;
use grip_sim::objects::ObjectModel;
use grip_sim::physics::{STEP_HZ, World};
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::scene::Scene;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::outcome::{Clauses, Measures};

/// A finger counts as pressing from this force on, newtons.
const PRESSING_N: f64 = 1.0;
/// Physics steps of pressing before the lift (25 ms), and of holding at the end of the carry (0.1 s).
const PINCHED_STEPS: u32 = 6;
const HELD_STEPS: u32 = 24;
/// Bounds of slip in the hand, metres and degrees: an item that moved more was not held, it was dragged along.
const SLIP_M: f64 = 0.020;
const SLIP_DEG: f64 = 20.0;
/// An item that must stand may lean this far, degrees.
const TILT_DEG: f64 = 30.0;
/// A lifted object's lowest point must rise by this much, metres.
const LIFT_M: f64 = 0.03;
/// An item counts as lost when it is this far below the table's top, metres.
const FALLEN_M: f64 = 0.05;

/// What one attempt at an object did, as physics saw it.
#[derive(Debug, Clone)]
pub struct Watch {
    object: usize,
    gripper_link: usize,
    start_lowest: f64,
    /// Physics steps in a row for which the object was pinched, and for which it was pinched and clear.
    pinched_steps: u32,
    clear_steps: u32,
    /// The clauses of success that concern the way of the object.
    pub clauses: Clauses,
    /// What those were judged by.
    pub measures: Measures,
    /// Gripper from object when the fingers had closed, for slip.
    held_at: Option<Isometry3<f64>>,
    /// Farthest that the object's origin moved in the hand while it was pinched, metres.
    pub slip_m: Option<f64>,
    /// Farthest that the object turned in the hand while it was pinched, radians.
    slip_rad: f64,
    /// Another object that the fingers pinched instead.
    pub wrong_object: Option<usize>,
}

impl Watch {
    /// Begins to watch an attempt at `object`.
    pub fn begin(world: &World, object: usize, gripper_link: usize) -> Self {
        Self {
            object,
            gripper_link,
            start_lowest: world.lowest_point(object),
            pinched_steps: 0,
            clear_steps: 0,
            clauses: Clauses::default(),
            measures: Measures::default(),
            held_at: None,
            slip_m: None,
            slip_rad: 0.0,
            wrong_object: None,
        }
    }

    /// A physics step of closing, lifting or carrying is done.
    pub fn step(&mut self, world: &World) {
        let pinched = world.contacts(self.object).pinched(PRESSING_N);
        let clear = pinched && self.is_clear(world);
        self.pinched_steps = if pinched { self.pinched_steps + 1 } else { 0 };
        self.clear_steps = if clear { self.clear_steps + 1 } else { 0 };
        let Some(held_at) = self.held_at.filter(|_| pinched) else { return };
        let moved = held_at.inverse() * self.gripper_from_object(world);
        self.slip_m = Some(self.slip_m.unwrap_or(0.0).max(moved.translation.vector.norm()));
        self.slip_rad = self.slip_rad.max(moved.rotation.angle());
        let risen = world.lowest_point(self.object) - self.start_lowest;
        if clear {
            self.measures.risen_m = self.measures.risen_m.max(risen);
        }
        self.clauses.lifted_clear |= risen >= LIFT_M && clear;
    }

    /// The fingers have closed; the lift begins.
    pub fn closed(&mut self, world: &World) {
        self.clauses.opposing_contacts = self.pinched_steps >= PINCHED_STEPS;
        let [right, left] = world.contacts(self.object).fingers.map(|finger| finger.force);
        self.measures.pinch_n = right.norm().min(left.norm());
        if self.measures.pinch_n > 0.0 {
            self.measures.pinch_dot = right.normalize().dot(&left.normalize());
        }
        self.held_at = Some(self.gripper_from_object(world));
        if !self.clauses.opposing_contacts {
            self.wrong_object = (0..world.object_count())
                .find(|&other| other != self.object && world.contacts(other).pinched(PRESSING_N));
        }
    }

    /// The carry is over.
    pub fn carried(&mut self) {
        self.measures.clear_s = f64::from(self.clear_steps) / f64::from(STEP_HZ);
        self.measures.slip_m = self.slip_m.unwrap_or(0.0);
        self.measures.slip_deg = self.slip_rad.to_degrees();
        self.clauses.held_after_carry = self.clear_steps >= HELD_STEPS;
        self.clauses.slip_within =
            self.slip_m.is_some_and(|slip| slip <= SLIP_M) && self.slip_rad <= SLIP_DEG.to_radians();
    }

    /// Whether the object touches nothing but the hand.
    fn is_clear(&self, world: &World) -> bool {
        let contacts = world.contacts(self.object);
        contacts.fixtures.is_empty() && contacts.objects.is_empty()
    }

    fn gripper_from_object(&self, world: &World) -> Isometry3<f64> {
        world.link_pose(self.gripper_link).inverse() * world.truth(self.object).iso()
    }
}

/// ADD and ADD-S of an estimate against the truth, metres.
pub fn pose_errors(
    model: &ObjectModel,
    truth: &Pose<Camera, Object>,
    estimate: &Pose<Camera, Object>,
) -> (f64, f64) {
    let points = model_points(model);
    (metrics::add(&points, truth, estimate), metrics::adds(&points, truth, estimate))
}

/// Vertices of the model, thinned to at most a thousand, evenly over the list; metres, its own frame.
pub fn model_points(model: &ObjectModel) -> Vec<Point3<f64>> {
    const MOST: usize = 1000;
    let vertices = &model.visual.mesh.positions;
    let step = vertices.len().div_ceil(MOST).max(1);
    vertices.iter().step_by(step).map(|p| p.cast()).collect()
}

/// Whether object `index` is inside the bin: the centre of its bounding box between the walls, its lowest point below
/// their edge, and nothing touched but the bin and other objects. An item across the rim or held by the robot is not.
pub fn in_bin(world: &World, scene: &Scene, index: usize) -> bool {
    let centre = Point3::from(world.truth(index).translation());
    scene.bin.contains(&centre, world.object(index).diameter / 2.0)
        && below_edge_m(world, scene, index) > 0.0
        && !world.touches_beside_bin(index)
        && !world.contacts(index).touched_by_robot()
}

/// The angle between the z axis of object `index` and the vertical, degrees.
pub fn tilt_deg(world: &World, index: usize) -> f64 {
    world.truth(index).transform_vector(&Vector3::z()).angle(&Vector3::z()).to_degrees()
}

/// How far the lowest point of object `index` lies below the edge of the bin's walls, metres.
pub fn below_edge_m(world: &World, scene: &Scene, index: usize) -> f64 {
    scene.bin.world_from_bin().translation.z + scene.bin.wall_height - world.lowest_point(index)
}

/// Whether object `index` stands within the bound of upright, or is one that need not.
pub fn upright(world: &World, index: usize) -> bool {
    !world.object(index).info.upright || tilt_deg(world, index) <= TILT_DEG
}

/// Whether object `index` has fallen off the table.
fn has_fallen(world: &World, scene: &Scene, index: usize) -> bool {
    world.lowest_point(index) < scene.table.height - FALLEN_M
}

/// Where every item is, to see later what was knocked out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whereabouts {
    /// On the table.
    Table,
    /// In the bin.
    Bin,
    /// On the floor or anywhere else.
    Lost,
}

/// Where all items are.
pub fn whereabouts(world: &World, scene: &Scene) -> Vec<Whereabouts> {
    (0..world.object_count())
        .map(|i| {
            let p = world.truth(i).translation();
            if in_bin(world, scene, i) {
                Whereabouts::Bin
            } else if scene.table.holds(p.x, p.y) && !has_fallen(world, scene, i) {
                Whereabouts::Table
            } else {
                Whereabouts::Lost
            }
        })
        .collect()
}

/// Items other than `handled` that left the table for the floor, or the bin for anywhere.
pub fn knocked_out(before: &[Whereabouts], after: &[Whereabouts], handled: usize) -> Vec<usize> {
    (0..before.len())
        .filter(|&i| i != handled && before[i] != Whereabouts::Lost)
        .filter(|&i| {
            after[i] == Whereabouts::Lost || (before[i] == Whereabouts::Bin && after[i] != Whereabouts::Bin)
        })
        .collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use crate::setup::Setup;
    use Whereabouts::{Bin, Lost, Table};
    use clap::Parser;
    use grip_manip::GraspAt;
    use grip_sim::physics::Grip;
    use nalgebra::UnitQuaternion;

    /// The default scene with the robot, but no objects.
    pub fn empty() -> (Setup, World) {
        let Command::Pack(args) = Cli::parse_from(["grip", "pack"]).command else { unreachable!() };
        let setup = Setup::load(&args.scene, &args.condition).unwrap();
        let world =
            World::new(&setup.scene, setup.robot.clone(), &setup.config, setup.start.clone()).unwrap();
        (setup, world)
    }

    /// Drops the scene's soup can at a point of the bin's frame, at rest above it, and lets it settle.
    fn can_at(x: f64, y: f64, z: f64) -> (bool, Whereabouts) {
        let (setup, mut world) = empty();
        let can = setup.models.iter().find(|m| m.info.name == "005_tomato_soup_can").unwrap();
        let at = setup.scene.bin.world_from_bin() * nalgebra::Isometry3::translation(x, y, z);
        world.add_object(can.clone(), &Pose::new(at)).unwrap();
        world.settle(3.0);
        (in_bin(&world, &setup.scene, 0), whereabouts(&world, &setup.scene)[0])
    }

    #[test]
    fn in_the_bin_means_inside_it_and_nowhere_else() {
        assert_eq!(can_at(0.0, 0.0, 0.06), (true, Bin));
        // Beside the bin on the table; the bin's y axis points away from the objects.
        assert_eq!(can_at(0.3, 0.0, 0.06), (false, Table));
        // Far off the table.
        assert_eq!(can_at(0.0, -1.5, 0.06), (false, Lost));
    }

    #[test]
    fn what_hangs_over_the_rim_or_is_held_up_is_not_in_the_bin() {
        let (setup, mut world) = empty();
        let sugar = setup.models.iter().find(|m| m.info.name == "004_sugar_box").unwrap();
        // Flat across the wall, its centre just inside: the wall's top carries it at first.
        let bin = &setup.scene.bin;
        let lying = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let on_rim = nalgebra::Isometry3::from_parts(
            [bin.inner[0] / 2.0 - 0.01, 0.0, bin.wall_height + 0.05].into(),
            lying,
        );
        world.add_object(sugar.clone(), &Pose::new(bin.world_from_bin() * on_rim)).unwrap();
        assert!(!in_bin(&world, &setup.scene, 0), "its lowest point is above the edge");
    }

    #[test]
    fn an_item_that_must_stand_may_not_lie() {
        let (setup, mut world) = empty();
        let mug = setup.library.load("025_mug").unwrap();
        for roll in [0.0, 1.4] {
            let at = Pose::from_xyz_rpy([0.6, 0.1, 0.75], [roll, 0.0, 0.0]);
            world.add_object(mug.clone(), &at).unwrap();
        }
        assert!(upright(&world, 0) && !upright(&world, 1));
        let can = setup.models.iter().find(|m| m.info.name == "005_tomato_soup_can").unwrap();
        world.add_object(can.clone(), &Pose::from_xyz_rpy([0.6, 0.3, 0.75], [1.4, 0.0, 0.0])).unwrap();
        assert!(upright(&world, 2), "a can may lie");
    }

    #[test]
    fn knocked_out_means_off_the_table_or_out_of_the_bin() {
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Bin, Table, Bin], 0), Vec::<usize>::new());
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Bin, Lost, Bin], 0), vec![1]);
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Table, Table, Table], 0), vec![2]);
        // What is handled itself is judged by its own clauses.
        assert_eq!(knocked_out(&[Table], &[Lost], 0), Vec::<usize>::new());
    }

    /// A hand above a soup can on the table, and the score watching.
    struct Bench {
        world: World,
        watch: Watch,
        solver: grip_manip::ik::IkSolver,
        /// All movable joints as they are told.
        q: Vec<f64>,
        grip: Grip,
    }

    impl Bench {
        /// Fingers open about the can, which stands `aside` metres from between them.
        fn about_the_can(aside: f64) -> Self {
            let (setup, _) = empty();
            let planner = setup.planner(GraspAt::Best);
            let solver = grip_manip::ik::IkSolver::new(planner.robot().clone(), &setup.config);
            let top = setup.scene.table.height + 0.1018;
            let down = Isometry3::from_parts(
                [0.6, 0.1, top - 0.002].into(),
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2),
            );
            let base_from_gripper = setup.scene.world_from_base().iso().inverse() * down;
            let q = solver.solutions(&base_from_gripper, &setup.start, 16, 1, |_| true).remove(0);
            let mut world = World::new(&setup.scene, setup.robot.clone(), &setup.config, q.clone()).unwrap();
            let can = setup.library.load("005_tomato_soup_can").unwrap();
            let at = Pose::from_xyz_rpy([0.6 + aside, 0.1, top - 0.0509], [0.0; 3]);
            world.add_object(can, &at).unwrap();
            let mut bench = Self {
                watch: Watch::begin(&world, 0, setup.config.gripper.link),
                world,
                solver,
                q,
                grip: Grip::Open { width: 0.1 },
            };
            bench.wait(0.5);
            bench.watch = Watch::begin(&bench.world, 0, setup.config.gripper.link);
            bench
        }

        fn wait(&mut self, seconds: f64) {
            for _ in 0..(seconds * f64::from(STEP_HZ)) as u32 {
                self.world.step(&self.q, self.grip);
                self.watch.step(&self.world);
            }
        }

        fn close(&mut self, seconds: f64) -> &mut Self {
            self.grip = Grip::Close { force_n: 40.0 };
            self.wait(seconds);
            self.watch.closed(&self.world);
            self
        }

        /// Goes on closing without another word to the score.
        fn close_on(&mut self, seconds: f64) -> &mut Self {
            self.wait(seconds);
            self
        }

        /// Straight up or down at 0.1 m/s.
        fn lift(&mut self, metres: f64) -> &mut Self {
            let path =
                grip_manip::cartesian::translate(&self.solver, &self.q, Vector3::z() * metres, |_, _| None)
                    .unwrap();
            let pause = 10.0 * metres.abs() / (path.waypoints.len() - 1) as f64;
            for q in &path.waypoints {
                self.q.clone_from(q);
                self.wait(pause);
            }
            self.wait(0.3);
            self
        }

        fn carried(&mut self) -> [bool; 4] {
            assert!(self.world.stop().is_none(), "{:?}", self.world.stop());
            self.watch.carried();
            let c = self.watch.clauses;
            [c.opposing_contacts, c.lifted_clear, c.held_after_carry, c.slip_within]
        }
    }

    /// Every clause of the way has a case that physics decides and that fails by it alone.
    #[test]
    fn each_clause_of_the_way_can_fail_alone() {
        let begin = || Bench::about_the_can(0.0);
        assert_eq!(begin().close(1.5).lift(0.15).carried(), [true; 4]);
        // The lift began before the fingers pressed.
        assert_eq!(begin().close(0.02).close_on(1.5).lift(0.15).carried(), [false, true, true, true]);
        // Two centimetres are no lift.
        assert_eq!(begin().close(1.5).lift(0.02).carried(), [true, false, true, true]);
        // Back on the table before the carry was over.
        assert_eq!(begin().close(1.5).lift(0.15).lift(-0.16).carried(), [true, true, false, true]);
        // Pushed up in the hand by the table.
        let slipped = begin().close(1.5).lift(0.06).lift(-0.09).lift(0.15).carried();
        assert_eq!(slipped, [true, true, true, false]);
        // Beside the can nothing holds.
        assert_eq!(Bench::about_the_can(0.12).close(1.5).lift(0.15).carried(), [false; 4]);
    }
}
