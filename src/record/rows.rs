//! The tables of a recording, a struct each: its fields are the columns, and what is said of them here is what docs/recordings.md says.

use grip_sim::pose::Pose;
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Serialize;

use crate::table::{Column, Columns};

/// A position and an orientation; metres, and a unit quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Place {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Metres.
    pub z: f64,
    /// Of the quaternion.
    pub qx: f64,
    /// Of the quaternion.
    pub qy: f64,
    /// Of the quaternion.
    pub qz: f64,
    /// Of the quaternion.
    pub qw: f64,
}

impl Place {
    /// Of an isometry.
    pub fn of(pose: &Isometry3<f64>) -> Self {
        let (t, q) = (&pose.translation.vector, &pose.rotation);
        Self { x: t.x, y: t.y, z: t.z, qx: q.i, qy: q.j, qz: q.k, qw: q.w }
    }

    fn parts(&self) -> [f64; 7] {
        [self.x, self.y, self.z, self.qx, self.qy, self.qz, self.qw]
    }
}

impl<A, B> From<&Pose<A, B>> for Place {
    fn from(pose: &Pose<A, B>) -> Self {
        Self::of(pose.iso())
    }
}

/// What may stand in a field: it becomes one column or several.
pub trait Cell: Sized {
    /// What is added to the field's name, a column each.
    const PARTS: &'static [&'static str] = &[""];
    /// In words.
    const KIND: &'static str;

    /// The columns of so many values.
    fn columns<'a>(values: impl Iterator<Item = &'a Self>) -> Vec<Column>
    where
        Self: 'a;
}

macro_rules! cell {
    ($type:ty, $kind:literal, $column:ident, $value:expr) => {
        impl Cell for $type {
            const KIND: &'static str = $kind;

            fn columns<'a>(values: impl Iterator<Item = &'a Self>) -> Vec<Column> {
                vec![Column::$column(values.map($value).collect())]
            }
        }
    };
}

cell!(String, "text", Text, String::clone);
cell!(i64, "whole number", Whole, |v| *v);
cell!(bool, "yes or no", Yes, |v| *v);
cell!(f64, "number", Number, |v| Some(*v));
cell!(Option<f64>, "number or nothing", Number, |v| *v);
cell!(f32, "number, single precision", Single, |v| *v);

impl Cell for Option<Place> {
    const PARTS: &'static [&'static str] = &["_x", "_y", "_z", "_qx", "_qy", "_qz", "_qw"];
    const KIND: &'static str = "seven numbers or nothing: metres, quaternion";

    fn columns<'a>(values: impl Iterator<Item = &'a Self>) -> Vec<Column> {
        let values: Vec<Option<[f64; 7]>> = values.map(|place| place.map(|place| place.parts())).collect();
        let part = |k: usize| values.iter().map(|parts| parts.map(|parts| parts[k])).collect();
        (0..7).map(|k| Column::Number(part(k))).collect()
    }
}

impl Cell for [f32; 3] {
    const PARTS: &'static [&'static str] = &["_x", "_y", "_z"];
    const KIND: &'static str = "three numbers, single precision";

    fn columns<'a>(values: impl Iterator<Item = &'a Self>) -> Vec<Column> {
        let values: Vec<&Self> = values.collect();
        (0..3).map(|k| Column::Single(values.iter().map(|v| v[k]).collect())).collect()
    }
}

impl Cell for [f32; 4] {
    const PARTS: &'static [&'static str] = &["_x", "_y", "_z", "_w"];
    const KIND: &'static str = "four numbers, single precision";

    fn columns<'a>(values: impl Iterator<Item = &'a Self>) -> Vec<Column> {
        let values: Vec<&Self> = values.collect();
        (0..4).map(|k| Column::Single(values.iter().map(|v| v[k]).collect())).collect()
    }
}

/// A row of a table.
pub trait Row: Sized {
    /// The table's name, and its file's.
    const TABLE: &'static str;
    /// What a row is.
    const ABOUT: &'static str;

    /// Rows as columns.
    fn columns(rows: &[Self]) -> Columns;

    /// Name, kind and meaning of each field.
    fn fields() -> Vec<Described>;
}

/// A field of a table, for the page that lists them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Described {
    /// Its columns.
    pub columns: Vec<String>,
    /// What may stand in it.
    pub kind: &'static str,
    /// What it means, with its unit.
    pub about: &'static str,
}

macro_rules! rows {
    ($(#[doc = $about:literal])+ $name:ident in $table:literal { $($(#[doc = $doc:literal])+ $field:ident: $type:ty,)+ }) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
        pub struct $name {
            $($(#[doc = $doc])+ pub $field: $type,)+
        }

        impl Row for $name {
            const TABLE: &'static str = $table;
            const ABOUT: &'static str = concat!($($about),+);

            fn columns(rows: &[Self]) -> Columns {
                let mut columns = Columns::new();
                $(
                    let names = <$type as Cell>::PARTS.iter().map(|part| format!("{}{part}", stringify!($field)));
                    columns.extend(names.zip(<$type as Cell>::columns(rows.iter().map(|row| &row.$field))));
                )+
                columns
            }

            fn fields() -> Vec<Described> {
                vec![$(Described {
                    columns: <$type as Cell>::PARTS.iter().map(|part| format!("{}{part}", stringify!($field))).collect(),
                    kind: <$type as Cell>::KIND,
                    about: concat!($($doc),+),
                }),+]
            }
        }
    };
}

rows! {
    /// A look of the robot, and what it decided to do.
    Look in "looks" {
        /// Number of the look, from 0 on.
        look: i64,
        /// Simulated time, seconds.
        time_s: f64,
        /// World from camera (x right, y down, z forward), by the joints' encoders.
        camera: Option<Place>,
        /// Objects whose poses were asked for.
        asked: i64,
        /// Objects in the belief: those whose estimate was enough to act by, and those put into the bin.
        believed: i64,
        /// Depth readings that nothing believed explains: obstacles.
        unmodelled: i64,
        /// What is done next.
        decision: String,
    }
}

rows! {
    /// An estimate of one object at a look, beside the truth.
    Estimate in "estimates" {
        /// Number of the look.
        look: i64,
        /// Simulated time, seconds.
        time_s: f64,
        /// The object's name.
        object: String,
        /// Which of several of that name, from 1 on.
        instance: i64,
        /// Whether it was looked for in the bin, where it had been put.
        in_bin: bool,
        /// 0 to 1.
        confidence: f64,
        /// Whether the confidence is enough to act by.
        believed: bool,
        /// World from object, as estimated.
        estimate: Option<Place>,
        /// World from object, as it is.
        truth: Option<Place>,
        /// Mean distance of corresponding model points, metres.
        add_m: f64,
        /// The same to the nearest point, metres.
        adds_m: f64,
        /// Distance of the two origins, metres.
        position_error_m: f64,
        /// Angle between the two orientations, degrees; of what looks the same when it is turned that says little.
        rotation_error_deg: f64,
        /// Spread of the position by the estimator's own account, metres.
        position_std_m: Option<f64>,
        /// Places where the object may be, by the estimator's own account.
        modes: i64,
    }
}

rows! {
    /// A search for a way to pack an object or to put it aside, and what became of all candidates. `candidates` of the object's grasps are
    /// there; `oriented` have the right direction; `tried` of them, the best and no two alike, with the hand's solids, of which `blocked_`
    /// and `closing_` ran into something and `free` did not; `grasps_tried` of these with the arm.
    Plan in "plans" {
        /// Number of the look.
        look: i64,
        /// Simulated time, seconds.
        time_s: f64,
        /// The object's name.
        object: String,
        /// Which of several of that name.
        instance: i64,
        /// `pack` or `aside`.
        action: String,
        /// `averse`: firm grasps, what nothing lies on; or `tolerant`.
        risk: String,
        /// Whether a way was found.
        found: bool,
        /// How far it came, if not.
        stage: String,
        /// Why not.
        reason: String,
        /// Grasps of the object.
        candidates: i64,
        /// Of those, approached from where the hand is to come from and clear of the table.
        oriented: i64,
        /// Of those, tried with the hand's solids.
        tried: i64,
        /// Hands at the grasp or on the way in that ran into table, bin or shelf,
        blocked_fixtures: i64,
        /// other believed objects,
        blocked_objects: i64,
        /// readings that nothing explains.
        blocked_unmodelled: i64,
        /// Hands that ran into table, bin or shelf as they closed,
        closing_fixtures: i64,
        /// into other objects,
        closing_objects: i64,
        /// into readings that nothing explains.
        closing_unmodelled: i64,
        /// Hands that were free.
        free: i64,
        /// Grasps tried with the arm.
        grasps_tried: i64,
        /// Arms at these that ran into table, bin or shelf,
        arm_fixtures: i64,
        /// other objects,
        arm_objects: i64,
        /// readings that nothing explains,
        arm_unmodelled: i64,
        /// or themselves.
        arm_robot: i64,
        /// Grasps reached,
        reached: i64,
        /// of those approached straight,
        approached: i64,
        /// of those lifted straight.
        lifted: i64,
        /// Places in the bin.
        places: i64,
        /// Pairs of grasp and place tried,
        places_tried: i64,
        /// of those reached and lowered to.
        places_reached: i64,
        /// Searches for a free path.
        searches: i64,
        /// Their extensions.
        iterations: i64,
        /// Their collision checks.
        checks: i64,
        /// Object from gripper (origin between the pads, x out along the fingers, y along the closing direction) of the chosen grasp.
        grasp: Option<Place>,
        /// Expected distance of the pads, metres.
        width_m: Option<f64>,
        /// Distance of the pads on the way in, metres.
        opening_m: Option<f64>,
        /// Distance of the hand from everything else, metres, at most the setting `clearance_full`.
        clearance_m: Option<f64>,
        /// Horizontal distance of the centre of mass from the grasp, metres.
        lever_m: Option<f64>,
        /// Share of the pads in contact, 0 to 1.
        contact_share: Option<f64>,
        /// The grasp's score; larger is better.
        score: Option<f64>,
        /// World from object where it is to lie.
        place: Option<Place>,
        /// Duration of all motions, seconds.
        motion_s: Option<f64>,
    }
}

rows! {
    /// An attempt at an object, as the robot and as the score saw it.
    Attempt in "attempts" {
        /// Number of the attempt in the trial, from 0 on.
        attempt: i64,
        /// Number of the look before it.
        look: i64,
        /// The object's name.
        object: String,
        /// Which of several of that name.
        instance: i64,
        /// `pack`, `aside` or `push`.
        action: String,
        /// Simulated time at its beginning, seconds,
        begin_s: f64,
        /// and at its end.
        end_s: f64,
        /// Whether all steps were done, by the robot's own account.
        done: bool,
        /// The step that failed.
        failed_step: String,
        /// Why.
        reason: String,
        /// Distance of the pads when the fingers had closed, metres.
        grasp_width_m: Option<f64>,
        /// Largest contact force that the robot felt, newtons.
        peak_contact_n: f64,
        /// Largest force of the finger drives, newtons.
        peak_grip_n: f64,
        /// Largest normal force by any one body on the object, newtons.
        peak_force_n: f64,
        /// How far the object moved in the hand, metres; nothing where it was not held.
        slip_m: Option<f64>,
        /// How far it turned, degrees.
        slip_deg: Option<f64>,
        /// The fingers held another object than the one that was meant.
        wrong_object: bool,
        /// Clauses of success that are of the grasp (docs/experiments.md): both fingers pressed from opposite sides,
        opposing_contacts: bool,
        /// it left what it lay on,
        lifted_clear: bool,
        /// it was still held at the end of the carry,
        held_after_carry: bool,
        /// and hardly moved in the hand.
        slip_within: bool,
    }
}

rows! {
    /// A step of an attempt, as it went.
    Step in "steps" {
        /// Number of the attempt.
        attempt: i64,
        /// Which step: open, to_pregrasp, approach, close, lift, carry, lower, release, retreat, home, shake, push.
        step: String,
        /// Simulated time at its beginning, seconds,
        begin_s: f64,
        /// and at its end.
        end_s: f64,
        /// Largest force felt beside what was felt when it began, newtons.
        peak_contact_n: f64,
        /// The motion stopped on contact before its end.
        stopped_early: bool,
    }
}

rows! {
    /// Where an object was when everything had come to rest after an attempt.
    Rest in "rests" {
        /// Number of the attempt.
        attempt: i64,
        /// The object's name.
        object: String,
        /// Which of several of that name.
        instance: i64,
        /// `table`, `bin` or `lost`.
        location: String,
        /// World from object.
        truth: Option<Place>,
        /// How far a point of it moved since the attempt began, metres.
        moved_m: f64,
    }
}

rows! {
    /// A moment of a motion that was planned; the joints' columns are `q_` and the joint's name, radians or metres.
    Planned in "trajectories" {
        /// Number of the attempt.
        attempt: i64,
        /// Position of the step in the plan, from 0 on.
        part: i64,
        /// Which step.
        step: String,
        /// Since the motion's beginning, seconds.
        time_s: f64,
        /// Where the gripper is then, metres, world frame.
        hand: [f32; 3],
    }
}

rows! {
    /// A moment of what happened; the joints' columns are `q_` and the joint's name, radians or metres.
    Sample in "samples" {
        /// Simulated time, seconds.
        time_s: f64,
        /// Number of the attempt, from 0 on; -1 before the first.
        attempt: i64,
        /// Which step.
        step: String,
        /// Distance of the pads, metres.
        width_m: f32,
        /// Force of the finger drives, newtons.
        grip_force_n: f32,
        /// Force on the hand as its sensor measures it, newtons, world frame.
        hand_force_n: [f32; 3],
        /// Largest contact force on a link that is no finger, newtons.
        link_force_n: f32,
        /// Normal force of the right finger on the object of the attempt, newtons,
        right_finger_n: f32,
        /// of the left finger,
        left_finger_n: f32,
        /// and of all that it lies on or touches.
        support_n: f32,
        /// How far the object has moved in the hand since the fingers closed, metres; 0 where it is not held,
        slip_m: f32,
        /// and turned, degrees.
        slip_deg: f32,
    }
}

rows! {
    /// Where a body is; a row only where it has moved since its last one.
    Moved in "poses" {
        /// Simulated time, seconds.
        time_s: f64,
        /// `object`, or `link` of the robot.
        kind: String,
        /// Its name.
        name: String,
        /// Which of several objects of that name; 1 of links.
        instance: i64,
        /// World from body, metres.
        position: [f32; 3],
        /// The quaternion.
        rotation: [f32; 4],
    }
}

rows! {
    /// What a body does to an object at a moment.
    Contact in "contacts" {
        /// Simulated time, seconds.
        time_s: f64,
        /// The object's name.
        object: String,
        /// Which of several of that name.
        instance: i64,
        /// What touches it: the name of a link, a fixture or another object.
        by: String,
        /// Middle of the contact points, weighted by their forces, metres, world frame.
        point: [f32; 3],
        /// Normal force on the object, newtons, world frame.
        force_n: [f32; 3],
        /// Friction on the object, newtons, world frame.
        friction_n: [f32; 3],
    }
}

rows! {
    /// How long something took: all that differs from run to run.
    Time in "times" {
        /// Number of the look.
        look: i64,
        /// `picture`, `estimate` (all objects), `estimate_in_bin`, `obstacles`, `plan` or `act`.
        what: String,
        /// The object's name, where it is for one.
        object: String,
        /// Wall time, seconds.
        seconds: f64,
    }
}
