//! Whether an object stands where it is put: its centre of mass has to be above the hull of what bears it, and what bears it
//! must not break.

use std::f64::consts::TAU;

use grip_sim::objects::ObjectModel;
use nalgebra::Vector2;

use super::height_map::{HeightMap, Profile};
use crate::belief::BeliefScene;

/// How many directions there are in which supports are looked for.
const DIRECTIONS: usize = 16;

/// Unit vectors all round: their x and their y.
pub(super) fn directions() -> [[f32; DIRECTIONS]; 2] {
    let around: [f32; DIRECTIONS] = std::array::from_fn(|k| TAU as f32 * k as f32 / DIRECTIONS as f32);
    [around.map(f32::cos), around.map(f32::sin)]
}

/// How an object is borne at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Support {
    /// Its centre of mass is above the hull of what bears it.
    Stands,
    /// Something bears it on every side, but its centre of mass is not above the hull of that: it comes to lean.
    Tips,
    /// It falls over, or would crush what is below.
    None,
}

/// What a place is checked with.
pub(super) struct SupportCheck<'a> {
    pub model: &'a ObjectModel,
    /// Its centre of mass from its origin, cells along the bin's x and y.
    pub center: Vector2<f64>,
    /// Unit vectors all round: their x and their y.
    pub directions: [[f32; DIRECTIONS]; 2],
    pub belief: &'a BeliefScene,
    pub owner: &'a [Option<usize>],
    /// A gap below this counts as support, metres.
    pub gap: f64,
    /// How far what bears it must reach beyond its centre of mass in each direction for it to stand, cells.
    pub needed: [f32; DIRECTIONS],
    /// How deep what is below it may be where it tips, metres.
    pub tip_fall: f64,
}

/// What [`SupportCheck::needed`] is for an object with a `profile`: `margin` cells, or half of how far it reaches itself, and a cell to
/// spare.
pub(super) fn needed(
    profile: &Profile,
    center: &Vector2<f64>,
    [xs, ys]: &[[f32; DIRECTIONS]; 2],
    margin: f64,
) -> [f32; DIRECTIONS] {
    std::array::from_fn(|k| {
        let along = |offset: &[i32; 2]| {
            let [x, y] = [0, 1].map(|axis| (f64::from(offset[axis]) - center[axis]) as f32);
            x * xs[k] + y * ys[k]
        };
        let itself = profile.cells.iter().map(|(offset, ..)| along(offset)).fold(0.0, f32::max);
        (margin as f32).min(0.5 * itself).max(1.0)
    })
}

impl SupportCheck<'_> {
    /// What bears the object when its origin is at height `z`.
    pub fn support(
        &self,
        profile: &Profile,
        map: &HeightMap,
        z: f64,
        at: impl Fn(&[i32; 2]) -> usize,
    ) -> Support {
        let mut reach = [f32::NEG_INFINITY; DIRECTIONS];
        let mut deepest: f64 = 0.0;
        let [xs, ys] = &self.directions;
        for (offset, bottom, _) in &profile.cells {
            let index = at(offset);
            let gap = z + bottom - map.heights[index];
            deepest = deepest.max(gap);
            if gap > self.gap {
                continue;
            }
            if let Some(below) = self.owner[index] {
                let below = &self.belief.objects[below].model.info;
                if !below.fragility.bears(self.model.info.mass_kg) {
                    return Support::None;
                }
            }
            let [x, y] = [0, 1].map(|axis| (f64::from(offset[axis]) - self.center[axis]) as f32);
            for k in 0..DIRECTIONS {
                reach[k] = reach[k].max(x * xs[k] + y * ys[k]);
            }
        }
        if reach.iter().zip(&self.needed).all(|(reach, needed)| reach >= needed) {
            Support::Stands
        } else if deepest <= self.tip_fall && reach.iter().step_by(DIRECTIONS / 4).all(|reach| *reach >= 1.0)
        {
            Support::Tips
        } else {
            Support::None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, empty_scene};
    use nalgebra::Isometry3;

    #[test]
    fn the_centre_of_mass_is_between_the_supports() {
        // Three posts at corners of a square: the box about them has the middle inside, the triangle between them at its edge.
        let model = box_model("tray", [0.17, 0.17, 0.02]);
        let rest = Isometry3::identity();
        let profile = Profile::new(&model.visual.mesh, &rest, 0.01);
        let mut map = HeightMap::flat([-0.095, -0.095], [19, 19], 0.01, 0.0);
        let belief = empty_scene();
        let owner = vec![None; map.heights.len()];
        let borne = |map: &HeightMap, center: [f64; 2]| {
            let check = SupportCheck {
                model: &model,
                center: center.into(),
                directions: directions(),
                belief: &belief,
                owner: &owner,
                gap: 0.006,
                needed: [1.0; DIRECTIONS],
                tip_fall: 0.2,
            };
            check.support(&profile, map, 0.11, |o| ((o[0] + 9) + (o[1] + 9) * 19) as usize)
        };
        for (x, y) in [(1, 17), (17, 1), (17, 17)] {
            map.heights[x + y * 19] = 0.1;
        }
        assert_eq!(borne(&map, [0.0, 0.0]), Support::Tips, "over the edge between the far posts");
        assert_eq!(borne(&map, [3.0, 3.0]), Support::Stands);
        assert_eq!(borne(&map, [-3.0, -3.0]), Support::Tips);
        assert_eq!(borne(&map, [-10.0, 0.0]), Support::None);
        map.heights[1 + 19] = 0.1;
        assert_eq!(borne(&map, [0.0, 0.0]), Support::Stands);
        assert_eq!(borne(&map, [-3.0, -3.0]), Support::Stands);
    }

    #[test]
    fn what_bears_an_object_reaches_beyond_its_centre_and_where_it_tips_it_falls_little() {
        let model = box_model("tray", [0.17, 0.17, 0.02]);
        let profile = Profile::new(&model.visual.mesh, &Isometry3::identity(), 0.01);
        let belief = empty_scene();
        // A cap of 3 by 3 cells, 0.1 m above the floor, on what is `deep` below it.
        let borne = |margin: f64, deep: f64| {
            let mut map = HeightMap::flat([-0.095, -0.095], [19, 19], 0.01, 0.1 - deep);
            let owner = vec![None; map.heights.len()];
            for (x, y) in (8..=10).flat_map(|x| [(x, 8), (x, 9), (x, 10)]) {
                map.heights[x + y * 19] = 0.1;
            }
            let (center, directions) = (Vector2::zeros(), directions());
            let needed = needed(&profile, &center, &directions, margin / 0.01);
            let check = SupportCheck {
                model: &model,
                center,
                directions,
                belief: &belief,
                owner: &owner,
                gap: 0.006,
                needed,
                tip_fall: 0.04,
            };
            check.support(&profile, &map, 0.11, |o| ((o[0] + 9) + (o[1] + 9) * 19) as usize)
        };
        assert_eq!(borne(0.01, 0.1), Support::Stands);
        assert_eq!(borne(0.015, 0.1), Support::None);
        assert_eq!(borne(0.015, 0.05), Support::None);
        assert_eq!(borne(0.015, 0.03), Support::Tips);
        // Half as far as the object reaches is enough, however much is asked for: here 4 cells.
        assert_eq!(borne(0.1, 0.0), Support::Stands);
    }
}
