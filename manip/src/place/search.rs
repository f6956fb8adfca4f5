//! Where to put an object in the bin: height map minimisation (Wang and Hauser 2018).
//!
//! The believed tops of packed items make a height map of the bin's floor. For each heading of the object every place
//! is tried in which its outline stays clear of the walls: there it comes to rest where its lower side first meets
//! the map. The best place adds the least to the pile, voids included.

use std::f64::consts::{PI, TAU};

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Object, Pose, World};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::height_map::{HeightMap, Profile};
use super::settings::PlaceSettings;
use super::support::{Support, SupportCheck, directions, needed};
use crate::belief::BeliefScene;
use crate::motion::wrap;
use crate::stable::{nearest_standing, stable_facets};
use crate::surface::center_of_mass;

/// A place in the bin.
#[derive(Debug, Clone, Serialize)]
pub struct PlacePose {
    /// The object at rest there.
    pub world_from_object: Pose<World, Object>,
    /// Centre of the object in the bin's frame, metres.
    pub bin_xy: [f64; 2],
    /// Turn about the vertical from the orientation that it has now (or from its upright one), radians.
    pub heading: f64,
    /// Height of its lowest point above the bin's floor, metres.
    pub support_height: f64,
    /// Height of its highest point above the bin's floor, metres.
    pub top_height: f64,
    /// Litres that it adds to the pile, plus tie breakers; lower is better.
    pub cost: f64,
    /// Whether it stands there; else it leans on what is beside it, or tips over.
    pub stands: bool,
}

/// Where someone wants an object to be put, in the bin's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaceWish {
    /// Centre of the object, metres.
    pub bin_xy: [f64; 2],
    /// Turn about the vertical from the orientation that it has now (or from its upright one), radians; any where none is given.
    pub heading: Option<f64>,
}

impl PlaceWish {
    /// How far a place may be from what is wished, metres; as near as places are tried at all, and half as much again.
    const NEAR_M: f64 = 0.015;

    /// How far a place is from it; none where that is too far.
    fn distance(&self, place: &PlacePose, heading_step: f64) -> Option<f64> {
        let off = (place.bin_xy[0] - self.bin_xy[0]).hypot(place.bin_xy[1] - self.bin_xy[1]);
        let turned = self.heading.map_or(0.0, |heading| wrap(place.heading - heading).abs());
        // A centimetre is as bad as a step of the headings.
        (off <= Self::NEAR_M && turned <= heading_step).then_some(off + 0.01 * turned / heading_step)
    }
}

/// The map of packed items' tops above the bin's floor, and which item each cell belongs to.
pub fn bin_map(belief: &BeliefScene, cell: f64) -> (HeightMap, Vec<Option<usize>>) {
    let inner = belief.bin.inner;
    let size = inner.map(|v| ((v / cell).floor() as usize).clamp(1, 2000));
    let origin = inner.map(|v| -0.5 * v);
    let mut map = HeightMap::flat(origin, size, cell, 0.0);
    let mut owner = vec![None; map.heights.len()];
    let bin_from_world = belief.bin.world_from_bin.iso().inverse();
    // Everything that stands in the bin counts, whether it was packed or fell in.
    for (k, object) in belief.objects.iter().enumerate() {
        let bin_from_object = bin_from_world * object.world_from_object.iso();
        if object.packed || inside(&bin_from_object, inner) {
            map.rasterize(&object.model.visual.mesh, &bin_from_object, |height, z, index| {
                if z > *height {
                    *height = z;
                    owner[index] = Some(k);
                }
            });
        }
    }
    for point in &belief.unmodelled {
        let p = bin_from_world * point;
        let cell = [0, 1].map(|axis| ((p[axis] - origin[axis]) / cell).floor());
        if (0..2).all(|axis| cell[axis] >= 0.0 && cell[axis] < size[axis] as f64) && p.z < 0.5 {
            let index = cell[0] as usize + cell[1] as usize * size[0];
            if p.z > map.heights[index] {
                map.heights[index] = p.z;
                owner[index] = None;
            }
        }
    }
    (map, owner)
}

fn inside(bin_from_object: &Isometry3<f64>, inner: [f64; 2]) -> bool {
    let t = bin_from_object.translation.vector;
    t.x.abs() < 0.5 * inner[0] && t.y.abs() < 0.5 * inner[1] && t.z > -0.05 && t.z < 0.5
}

/// The orientation in which to put the object down, before the turn about the vertical: the nearest one in which it stands.
fn resting_rotation(model: &ObjectModel, now: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    if !model.info.upright {
        return nearest_standing(&stable_facets(&model.visual.mesh), now);
    }
    // YCB scans stand on their xy plane: z is up when upright.
    let up = now * Vector3::z();
    UnitQuaternion::rotation_between(&up, &Vector3::z())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI))
        * now
}

/// Places for object `target`, best first, none of them alike. Empty when there is none.
pub fn place_poses(belief: &BeliefScene, target: usize, settings: &PlaceSettings) -> Vec<PlacePose> {
    let mut found = all_places(belief, target, settings);
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<PlacePose> = Vec::new();
    for place in found {
        if kept.len() >= settings.keep {
            break;
        }
        let alike = |other: &PlacePose| {
            let d = (place.bin_xy[0] - other.bin_xy[0]).hypot(place.bin_xy[1] - other.bin_xy[1]);
            d < settings.distinct_distance
                && wrap(place.heading - other.heading).abs() < settings.distinct_angle
        };
        if !kept.iter().any(alike) {
            kept.push(place);
        }
    }
    kept
}

/// Places for object `target` where someone wants it, the nearest first. Empty when it can be put nowhere near.
pub fn wished_places(
    belief: &BeliefScene,
    target: usize,
    settings: &PlaceSettings,
    wish: &PlaceWish,
) -> Vec<PlacePose> {
    let step = TAU / settings.headings as f64;
    let near = |place: PlacePose| Some((wish.distance(&place, step)?, place));
    let mut found: Vec<(f64, PlacePose)> =
        all_places(belief, target, settings).into_iter().filter_map(near).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(settings.keep);
    found.into_iter().map(|(_, place)| place).collect()
}

/// All places for object `target`.
fn all_places(belief: &BeliefScene, target: usize, settings: &PlaceSettings) -> Vec<PlacePose> {
    let object = &belief.objects[target];
    let model = &object.model;
    let mut others = belief.clone();
    others.objects.remove(target);
    let (map, owner) = bin_map(&others, settings.cell);
    let world_from_bin = belief.bin.world_from_bin.iso();
    let rest = resting_rotation(model, &object.world_from_object.rotation());
    let rest = world_from_bin.rotation.inverse() * rest;
    let margin = settings.margin + object.position_std_m.clamp(0.0, 0.01);
    let margin = (margin / settings.cell).ceil() as i32;
    let [nx, ny] = map.size.map(|n| n as i32);
    let half = belief.bin.inner.map(|v| 0.5 * v);
    let center = center_of_mass(&model.visual.mesh);
    let directions = directions();

    let mut found: Vec<PlacePose> = Vec::new();
    for k in 0..settings.headings {
        let heading = TAU * k as f64 / settings.headings as f64;
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading) * rest;
        let rotation = Isometry3::from_parts(Translation3::identity(), turned);
        let profile = Profile::new(&model.visual.mesh, &rotation, settings.cell);
        let center = (turned * center).coords.xy() / settings.cell;
        let load = SupportCheck {
            model,
            center,
            directions,
            belief: &others,
            owner: &owner,
            gap: settings.support_gap,
            needed: needed(&profile, &center, &directions, settings.stand_margin / settings.cell),
            tip_fall: settings.tip_fall,
        };
        let wide = profile.dilated(margin);
        let Some(bounds) = bounds(&wide) else {
            return Vec::new();
        };
        for j in -bounds[1][0]..ny - bounds[1][1] {
            for i in -bounds[0][0]..nx - bounds[0][1] {
                // Every second cell both ways: 10 mm.
                if (i + j) % 2 != 0 || i % 2 != 0 {
                    continue;
                }
                let at = |offset: &[i32; 2]| ((i + offset[0]) + (j + offset[1]) * nx) as usize;
                let z = wide
                    .cells
                    .iter()
                    .fold(f64::NEG_INFINITY, |z, (offset, low, _)| z.max(map.heights[at(offset)] - low));
                let xy = [
                    (f64::from(i) + 0.5) * settings.cell - half[0],
                    (f64::from(j) + 0.5) * settings.cell - half[1],
                ];
                let tips = match load.support(&profile, &map, z, at) {
                    Support::Stands => 0.0,
                    Support::Tips => settings.tip_cost,
                    Support::None => continue,
                };
                let added: f64 = profile
                    .cells
                    .iter()
                    .map(|(offset, _, high)| (z + high - map.heights[at(offset)]).max(0.0))
                    .sum();
                let litres = added * settings.cell * settings.cell * 1000.0;
                let top = z + profile.span[1];
                // Ties: low, and towards the walls so that the middle stays open for the hand.
                let middle = (1.0 - xy[0].abs() / half[0]) + (1.0 - xy[1].abs() / half[1]);
                let pose = Isometry3::from_parts(Translation3::new(xy[0], xy[1], z), turned);
                found.push(PlacePose {
                    world_from_object: Pose::new(world_from_bin * pose),
                    bin_xy: xy,
                    heading,
                    support_height: z + profile.span[0],
                    top_height: top,
                    cost: litres + settings.height_cost * top + settings.middle_cost * middle + tips,
                    stands: tips == 0.0,
                });
            }
        }
    }
    found
}

/// Lowest and highest offset of the cells along x and y.
fn bounds(profile: &Profile) -> Option<[[i32; 2]; 2]> {
    let first = profile.cells.first()?.0;
    let mut b = [[first[0]; 2], [first[1]; 2]];
    for (offset, _, _) in &profile.cells {
        for axis in 0..2 {
            b[axis] = [b[axis][0].min(offset[axis]), b[axis][1].max(offset[axis])];
        }
    }
    Some(b)
}

/// The object's corners in the bin's frame: for checks of containment.
pub fn outline_in_bin(
    belief: &BeliefScene,
    model: &ObjectModel,
    world_from_object: &Pose<World, Object>,
) -> Vec<Point3<f64>> {
    let bin_from_object = belief.bin.world_from_bin.iso().inverse() * world_from_object.iso();
    model.visual.mesh.positions.iter().map(|p| bin_from_object * p.cast::<f64>()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::BelievedObject;
    use crate::testing::{box_model, cylinder_model, empty_scene, groceries, standing};
    use grip_sim::objects::Fragility;
    use proptest::prelude::*;
    use std::sync::Arc;

    #[test]
    fn every_place_is_inside_the_walls_and_above_what_is_packed() {
        let mut scene = groceries();
        let settings = PlaceSettings::default();
        // Pack all but the last, each at its best place.
        for k in 0..4 {
            let places = place_poses(&scene, k, &settings);
            assert!(places.len() > 10, "object {k}: {}", places.len());
            let (map, _) = bin_map(&scene, settings.cell);
            for place in &places {
                let model = scene.objects[k].model.clone();
                for p in outline_in_bin(&scene, &model, &place.world_from_object) {
                    assert!(p.x.abs() <= 0.20 - settings.margin + 0.005, "x {}", p.x);
                    assert!(p.y.abs() <= 0.15 - settings.margin + 0.005, "y {}", p.y);
                    assert!(p.z > -1e-6);
                    let cell = |v: f64, h: f64| ((v + h) / settings.cell).floor() as usize;
                    let index = cell(p.x, 0.20) + cell(p.y, 0.15) * map.size[0];
                    assert!(p.z >= map.heights[index] - 1e-6, "sinks into the pile");
                }
            }
            scene.objects[k].world_from_object = places[0].world_from_object;
            scene.objects[k].packed = true;
        }
        // Four groceries fit side by side: nothing needs to be stacked.
        for o in &scene.objects {
            let z = o.world_from_object.translation().z + o.model.min.z;
            assert!((z - 0.658).abs() < 0.005, "{} stands at {z}", o.name);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn every_place_of_any_box_is_inside_any_bin(
            size in prop::array::uniform3(0.03..0.2f64),
            pose in prop::array::uniform3(-3.0..3.0f64),
            inner in prop::array::uniform2(0.2..0.5f64),
            bin_yaw in -3.0..3.0f64,
        ) {
            let mut scene = empty_scene();
            scene.bin.inner = inner;
            scene.bin.world_from_bin = Pose::from_xyz_rpy([0.5, -0.4, 0.66], [0.0, 0.0, bin_yaw]);
            let model = box_model("box", size);
            scene.objects = vec![BelievedObject::new(model.clone(), Pose::from_xyz_rpy([0.6, 0.1, 0.75], pose))];
            let settings = PlaceSettings { headings: 8, ..PlaceSettings::default() };
            for place in place_poses(&scene, 0, &settings) {
                for p in outline_in_bin(&scene, &model, &place.world_from_object) {
                    // Outlines are known to a cell.
                    let room = |axis: usize| 0.5 * inner[axis] - p[axis].abs();
                    prop_assert!(room(0) > settings.margin - settings.cell, "{p}");
                    prop_assert!(room(1) > settings.margin - settings.cell, "{p}");
                    prop_assert!(p.z > -1e-6 && p.z < place.top_height + 1e-6, "{p}");
                }
            }
        }
    }

    #[test]
    fn an_upright_item_that_lies_is_stood_up() {
        let mut scene = groceries();
        let lying = Pose::from_xyz_rpy([0.6, 0.1, 0.684], [1.5, 0.0, 0.3]);
        scene.objects[0].world_from_object = lying;
        for place in place_poses(&scene, 0, &PlaceSettings::default()) {
            let up = place.world_from_object.transform_vector(&Vector3::z());
            assert!(up.z > 0.99, "{up}");
        }
    }

    #[test]
    fn an_upright_item_that_leans_is_put_down_level() {
        let mut scene = groceries();
        let mut model = (*scene.objects[0].model).clone();
        model.info.upright = true;
        scene.objects[0].model = Arc::new(model);
        scene.objects[0].world_from_object = Pose::from_xyz_rpy([0.6, 0.1, 0.75], [0.3, -0.2, 1.0]);
        let places = place_poses(&scene, 0, &PlaceSettings::default());
        assert!(!places.is_empty());
        assert!(places.iter().all(|p| p.world_from_object.transform_vector(&Vector3::z()).z > 0.9999));
    }

    #[test]
    fn nothing_heavy_goes_on_a_fragile_item_and_a_full_bin_has_no_place() {
        let mut scene = empty_scene();
        let mut eggs = (*box_model("eggs", [0.37, 0.27, 0.06])).clone();
        eggs.info.fragility = Fragility::Fragile;
        let mut packed = standing(&Arc::new(eggs), 0.0, 0.0, 0.0);
        let floor = scene.bin.world_from_bin;
        packed.world_from_object = Pose::new(floor.iso() * Isometry3::translation(0.0, 0.0, 0.03));
        packed.packed = true;
        scene.objects = vec![packed, standing(&cylinder_model("can", 0.033, 0.1), 0.6, 0.1, 0.0)];
        assert!(place_poses(&scene, 1, &PlaceSettings::default()).is_empty());
        // On a sturdy box of the same size it may stand.
        let mut sturdy = (*scene.objects[0].model).clone();
        sturdy.info.fragility = Fragility::Sturdy;
        scene.objects[0].model = Arc::new(sturdy);
        let places = place_poses(&scene, 1, &PlaceSettings::default());
        assert!(places.iter().all(|p| (p.support_height - 0.06).abs() < 0.001));
        assert!(!places.is_empty());
    }
}
