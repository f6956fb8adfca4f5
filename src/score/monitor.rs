//! Follows one attempt in the physics world.

use grip_physics::{STEP_HZ, World};
use nalgebra::Isometry3;

use super::outcome::{Clauses, Measures};
use crate::settings::SuccessCriteria;

/// What one attempt at an object did, as physics saw it.
#[derive(Debug, Clone)]
pub struct GraspMonitor {
    criteria: SuccessCriteria,
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
    /// Its lowest point when the fingers began to open.
    let_go_at: Option<f64>,
}

impl GraspMonitor {
    /// Begins to watch an attempt at `object`.
    pub fn begin(world: &World, object: usize, gripper_link: usize, criteria: &SuccessCriteria) -> Self {
        Self {
            criteria: criteria.clone(),
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
            let_go_at: None,
        }
    }

    /// The fingers begin to let go.
    pub fn lowered(&mut self, world: &World) {
        self.let_go_at = Some(world.lowest_point(self.object));
    }

    /// A physics step of letting go or drawing back is done.
    pub fn falling(&mut self, world: &World) {
        let Some(from) = self.let_go_at else { return };
        self.measures.release_m = (from - world.lowest_point(self.object)).max(0.0);
        if !world.contacts(self.object).touched_by_robot() {
            self.measures.landing_m_s = self.measures.landing_m_s.max(world.velocity(self.object).norm());
        }
    }

    /// A physics step of closing, lifting or carrying is done.
    pub fn step(&mut self, world: &World) {
        let pinched = self.pinches(world, self.object);
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
        self.clauses.lifted_clear |= risen >= self.criteria.lift_m && clear;
    }

    /// The fingers have closed; the lift begins.
    pub fn closed(&mut self, world: &World) {
        self.clauses.opposing_contacts = self.pinched_steps >= self.criteria.pinch_steps();
        let [right, left] = world.contacts(self.object).fingers.map(|finger| finger.force);
        self.measures.pinch_n = right.norm().min(left.norm());
        if self.measures.pinch_n > 0.0 {
            self.measures.pinch_dot = right.normalize().dot(&left.normalize());
        }
        self.held_at = Some(self.gripper_from_object(world));
        if !self.clauses.opposing_contacts {
            self.wrong_object =
                (0..world.object_count()).find(|&other| other != self.object && self.pinches(world, other));
        }
    }

    /// The carry is over.
    pub fn carried(&mut self) {
        self.measures.clear_s = f64::from(self.clear_steps) / f64::from(STEP_HZ);
        self.measures.slip_m = self.slip_m.unwrap_or(0.0);
        self.measures.slip_deg = self.slip_rad.to_degrees();
        self.clauses.held_after_carry = self.clear_steps >= self.criteria.hold_steps();
        self.clauses.slip_within = self.slip_m.is_some_and(|slip| slip <= self.criteria.slip_m)
            && self.slip_rad <= self.criteria.slip_deg.to_radians();
    }

    fn pinches(&self, world: &World, object: usize) -> bool {
        let mut opposing = self.criteria.opposing_dot;
        if self.criteria.friction_cone {
            // Along a line that lies in both cones; beyond a right angle any two do.
            let angle = 2.0 * world.pad_friction(object).atan();
            opposing = opposing.min(-angle.cos());
        }
        world.contacts(object).pinched(self.criteria.finger_force_n, opposing)
    }

    /// Whether the object touches nothing but the hand.
    fn is_clear(&self, world: &World) -> bool {
        let contacts = world.contacts(self.object);
        let carried = self.criteria.fingers_alone && contacts.link;
        contacts.fixtures.is_empty() && contacts.objects.is_empty() && !carried
    }

    /// How far the object has moved and turned in the hand since the fingers closed, metres and radians; none while it is not pinched.
    pub fn slip_now(&self, world: &World) -> Option<(f64, f64)> {
        let held_at = self.held_at.filter(|_| self.pinches(world, self.object))?;
        let moved = held_at.inverse() * self.gripper_from_object(world);
        Some((moved.translation.vector.norm(), moved.rotation.angle()))
    }

    fn gripper_from_object(&self, world: &World) -> Isometry3<f64> {
        world.link_pose(self.gripper_link).inverse() * world.truth(self.object).iso()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::tests::empty;
    use grip_physics::Grip;
    use grip_sim::mesh::{Material, Mesh, Visual};
    use grip_sim::objects::{ObjectInfo, ObjectModel};
    use grip_sim::pose::Pose;
    use grip_sim::shape::{CollisionShape, Convex};
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use std::sync::Arc;

    /// Height of a soup can, metres.
    const CAN: f64 = 0.1018;

    /// A solid of 0.35 kg.
    fn object(geometry: Convex, friction: f64) -> Arc<ObjectModel> {
        let piece = CollisionShape { pose: Isometry3::identity(), geometry };
        let points = match &piece.geometry {
            Convex::Hull { points } => points.clone(),
            Convex::Cuboid { half } => vec![Point3::from(-half), Point3::from(*half)],
            _ => Vec::new(),
        };
        let mesh = Mesh { positions: points.iter().map(|p| p.cast()).collect(), ..Mesh::default() };
        let info = ObjectInfo { friction, mass_kg: 0.35, ..empty().0.models[0].info.clone() };
        let visual = Visual { mesh: Arc::new(mesh), material: Material::default() };
        Arc::new(ObjectModel::new(info, visual, vec![piece]))
    }

    /// A hand above a solid on the table, and the score watching.
    struct Bench {
        world: World,
        monitor: GraspMonitor,
        solver: grip_manip::motion::IkSolver,
        /// All movable joints as they are told.
        q: Vec<f64>,
        grip: Grip,
        force_n: f64,
    }

    impl Bench {
        /// Fingers open about the can, which stands `aside` metres from between them.
        fn about_the_can(aside: f64) -> Self {
            Self::with(aside, CAN - 0.002, |_| {})
        }

        /// The same with the middle of the pads so far above the table, and other criteria.
        fn with(aside: f64, height: f64, change: impl Fn(&mut SuccessCriteria)) -> Self {
            let can = empty().0.library.load("005_tomato_soup_can").unwrap();
            Self::about(&can, [aside, CAN / 2.0], height, change)
        }

        /// About a solid whose origin is so far aside and above the table.
        fn about(
            model: &Arc<ObjectModel>,
            [aside, above]: [f64; 2],
            height: f64,
            change: impl Fn(&mut SuccessCriteria),
        ) -> Self {
            let (setup, _) = empty();
            let mut criteria = setup.settings.success.clone();
            change(&mut criteria);
            let planner = setup.planner();
            let (hand, criteria) = (setup.cell.config.gripper.link, &criteria);
            let solver = grip_manip::motion::IkSolver::new(planner.robot().clone(), &setup.cell.config);
            let table = setup.cell.scene.table.height;
            let down = Isometry3::from_parts(
                [0.6, 0.1, table + height].into(),
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2),
            );
            let base_from_gripper = setup.cell.scene.world_from_base().iso().inverse() * down;
            let q = solver.solutions(&base_from_gripper, &setup.cell.start, 16, 1, |_| true).remove(0);
            let mut world = setup.empty_world(q.clone()).unwrap();
            let at = Pose::from_xyz_rpy([0.6 + aside, 0.1, table + above], [0.0; 3]);
            world.add_object(model.clone(), &at).unwrap();
            let mut bench = Self {
                monitor: GraspMonitor::begin(&world, 0, hand, criteria),
                world,
                solver,
                q,
                grip: Grip::Open { width: 0.1 },
                force_n: 40.0,
            };
            bench.wait(0.5);
            bench.monitor = GraspMonitor::begin(&bench.world, 0, hand, criteria);
            bench
        }

        fn wait(&mut self, seconds: f64) {
            for _ in 0..(seconds * f64::from(STEP_HZ)) as u32 {
                self.world.step(&self.q, self.grip);
                self.monitor.step(&self.world);
            }
        }

        fn close(&mut self, seconds: f64) -> &mut Self {
            self.grip = Grip::Close { force_n: self.force_n };
            self.wait(seconds);
            self.monitor.closed(&self.world);
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
                grip_manip::motion::translate(&self.solver, &self.q, Vector3::z() * metres, |_, _| None)
                    .unwrap();
            let pause = 10.0 * metres.abs() / (path.waypoints.len() - 1) as f64;
            for q in &path.waypoints {
                self.q.clone_from(q);
                self.wait(pause);
            }
            self.wait(0.3);
            self
        }

        /// Opens the fingers and waits.
        fn let_go(&mut self) -> Measures {
            self.monitor.lowered(&self.world);
            self.grip = Grip::Open { width: 0.1 };
            for _ in 0..STEP_HZ {
                self.world.step(&self.q, self.grip);
                self.monitor.falling(&self.world);
            }
            self.monitor.measures
        }

        fn carried(&mut self) -> [bool; 4] {
            assert!(self.world.stop().is_none(), "{:?}", self.world.stop());
            self.monitor.carried();
            let c = self.monitor.clauses;
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
        // A bar held weakly by its end turns until its other end lies against the palm, which carries it then.
        let bar = object(Convex::Cuboid { half: [0.1, 0.02, 0.031].into() }, 0.6);
        let palm = |alone| {
            let mut bench =
                Bench::about(&bar, [0.06, 0.0311], 0.033, |criteria| criteria.fingers_alone = alone);
            bench.force_n = 7.5;
            bench.close(2.0).grip = Grip::Close { force_n: 6.5 };
            bench.lift(0.15).carried()
        };
        assert_eq!(palm(false), [true; 4]);
        assert_eq!(palm(true), [true, false, false, true]);
        // Beside the can nothing holds.
        assert_eq!(Bench::about_the_can(0.12).close(1.5).lift(0.15).carried(), [false; 4]);
    }

    #[test]
    fn a_can_that_is_let_go_in_the_air_falls_and_one_on_the_table_does_not() {
        for height in [0.08, 0.0] {
            let mut bench = Bench::about_the_can(0.0);
            bench.close(1.5).lift(0.1).lift(height - 0.1);
            let Measures { release_m, landing_m_s, .. } = bench.let_go();
            let fast = (2.0 * 9.81 * height).sqrt();
            assert!((release_m - height).abs() < 2e-3, "{height}: fell by {release_m}");
            assert!((landing_m_s - fast).abs() < 0.1, "{height}: {landing_m_s} m/s");
        }
    }

    /// A wedge on the table, whose faces the fingers press at 30 degrees: without a friction of its own, pads of 0.9 hold what is off a
    /// line by 48 degrees between them, and no 60.
    #[test]
    fn normals_that_friction_does_not_balance_do_not_oppose() {
        let (base, height) = (0.045, 0.06);
        let top = base - height * 30f64.to_radians().tan();
        let rims = [(base, 0.0), (top, height)];
        let points: Vec<_> = rims
            .iter()
            .flat_map(|&(half, z)| {
                [-1.0, 1.0].into_iter().flat_map(move |x| [-1.0, 1.0].map(|y| [0.03 * x, half * y, z]))
            })
            .map(Point3::from)
            .collect();
        let wedge = object(Convex::Hull { points }, 0.0);
        let opposing = |friction_cone| {
            let mut bench =
                Bench::about(&wedge, [0.0, 0.0], 0.07, |criteria| criteria.friction_cone = friction_cone);
            bench.close(1.5);
            let Measures { pinch_dot, pinch_n, .. } = bench.monitor.measures;
            assert!((pinch_dot + 0.5).abs() < 0.02 && pinch_n > 10.0, "{pinch_dot}, {pinch_n} N");
            bench.monitor.clauses.opposing_contacts
        };
        assert_eq!([opposing(false), opposing(true)], [true, false]);
    }
}
