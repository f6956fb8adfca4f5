//! Which object to pick first.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::belief::BeliefScene;
use crate::ranges::Ranges;
use crate::stable::{nearest_standing, stable_facets};

/// Settings of [`pick_order`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OrderSettings {
    /// Tilted by more than this from where it would stand, an object leans, radians, 0 to pi. Default 0.1.
    pub lean: f64,
    /// What leans and is nearer than this to something leans on it, metres, 0 to 1. Default 0.01.
    pub lean_gap: f64,
    /// Neighbours nearer than this are in the hand's way, metres, 0 to 1. Default 0.04.
    pub crowd_gap: f64,
}

impl Default for OrderSettings {
    fn default() -> Self {
        Self { lean: 0.1, lean_gap: 0.01, crowd_gap: 0.04 }
    }
}

impl OrderSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("lean", self.lean, 0.0..=std::f64::consts::PI, "radians")
            .number("lean_gap", self.lean_gap, 0.0..=1.0, "metres")
            .number("crowd_gap", self.crowd_gap, 0.0..=1.0, "metres")
            .result()
    }
}

/// The order in which to pick the objects that are not packed yet, in tiers: those that nothing lies on or leans against,
/// then those that one other object does, and so on. In a tier first those with the fewest near neighbours, then the nearest
/// to the robot, a decimetre of height counting like one of distance.
pub fn pick_order(belief: &BeliefScene, settings: &OrderSettings) -> Vec<Vec<usize>> {
    let base = belief.world_from_base.translation();
    let waiting: Vec<usize> = (0..belief.objects.len()).filter(|&i| !belief.objects[i].packed).collect();
    // Half extents along the world's axes about the centre.
    let reach = |i: usize| {
        let o = &belief.objects[i];
        let half = 0.5 * o.model.size();
        let r = o.world_from_object.rotation().to_rotation_matrix();
        r.matrix().abs() * half
    };
    let leans: Vec<bool> = belief
        .objects
        .iter()
        .map(|o| {
            let now = o.world_from_object.rotation();
            !o.packed
                && nearest_standing(&stable_facets(&o.model.visual.mesh), &now).angle_to(&now) > settings.lean
        })
        .collect();
    let mut keyed: Vec<(usize, usize, f64, usize)> = waiting
        .iter()
        .map(|&i| {
            let (t, half) = (belief.objects[i].world_from_object.translation(), reach(i));
            let (mut carries, mut crowd) = (0, 0);
            for &k in waiting.iter().filter(|&&k| k != i) {
                let (u, other) = (belief.objects[k].world_from_object.translation(), reach(k));
                let gap = |axis: usize| (t[axis] - u[axis]).abs() - half[axis] - other[axis];
                let beside = gap(0).max(gap(1));
                let above = u.z - other.z > t.z + 0.5 * half.z;
                let leaned_on = leans[k] && beside < settings.lean_gap && gap(2) < settings.lean_gap;
                carries += usize::from(beside < 0.0 && above || leaned_on);
                crowd += usize::from(beside < settings.crowd_gap && !above);
            }
            let distance = (t - base).xy().norm() - 2.0 * half.z;
            (carries, crowd, distance, i)
        })
        .collect();
    keyed.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)));
    keyed.chunk_by(|a, b| a.0 == b.0).map(|tier| tier.iter().map(|k| k.3).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, cylinder_model, empty_scene, standing};
    use grip_sim::pose::Pose;

    fn order(belief: &BeliefScene) -> Vec<Vec<usize>> {
        pick_order(belief, &OrderSettings::default())
    }

    #[test]
    fn what_others_lie_on_or_lean_against_comes_last() {
        let mut belief = empty_scene();
        let (carton, can) = (box_model("carton", [0.09, 0.04, 0.18]), cylinder_model("can", 0.033, 0.10));
        belief.objects = vec![standing(&carton, 0.55, 0.0, 0.0), standing(&can, 0.75, 0.2, 0.0)];
        assert_eq!(order(&belief), [[0, 1]], "the nearest first");
        // The can on top of the carton.
        let table = belief.table_height;
        belief.objects[1].world_from_object = Pose::from_xyz_rpy([0.55, 0.0, table + 0.23], [0.0; 3]);
        assert_eq!(order(&belief), [[1], [0]]);
        // A bottle beside it is no hindrance while it stands, and one to come first when it leans.
        let bottle = box_model("bottle", [0.04, 0.04, 0.16]);
        belief.objects[1] = standing(&bottle, 0.55, 0.045, 0.0);
        assert_eq!(order(&belief), [[0, 1]]);
        belief.objects[1].world_from_object =
            Pose::from_xyz_rpy([0.55, 0.075, table + 0.09], [0.4, 0.0, 0.0]);
        assert_eq!(order(&belief), [[1], [0]]);
    }
}
