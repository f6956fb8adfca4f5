//! The score card of a trial, beside what was packed: what an attempt did to other items, what the items suffered, and what
//! the bin looks like in the end (Wang and Hauser 2018, and the practice of published packing trials).

use grip_manip::place::bin_map;
use grip_manip::{BeliefScene, BelievedObject};
use grip_physics::World;

use super::bodies::Bodies;
use super::outcome::{BadPack, ItemResult, Outcome, ScoreCard};
use super::record::ItemRecord;
use crate::cell::Cell;
use crate::settings::ScoreSettings;

/// Fills the card when everything has come to rest. `items` are the results of the items that were asked for.
pub fn fill(
    cell: &Cell,
    settings: &ScoreSettings,
    world: &World,
    (records, bodies): (&[ItemRecord], &Bodies),
    items: &[ItemResult],
    (pushes, drift_m): (u32, f64),
) -> ScoreCard {
    let inside: Vec<usize> = (0..items.len()).filter(|&i| items[i].clauses.in_bin).collect();
    let bodies_inside: Vec<usize> = inside.iter().map(|&i| bodies.of(i)).collect();
    let sum = |count: fn(&ItemRecord) -> u32| records.iter().map(count).sum();
    let by_robot = |l: &ItemRecord| {
        let lost = |o: &Outcome| matches!(o, Outcome::SlippedOnLift | Outcome::DroppedInTransit);
        l.failed_attempts.iter().filter(|f| lost(&f.outcome)).count() as u32
    };
    // What the robot did not notice.
    let unnoticed = |i: &ItemResult| i.failed_attempts.len() < i.attempts as usize;
    let silent = items
        .iter()
        .filter(|i| unnoticed(i) && matches!(i.outcome, Outcome::SlippedOnLift | Outcome::DroppedInTransit));
    ScoreCard {
        attempts: sum(|l| l.attempts),
        put_aside: sum(|l| l.put_aside),
        pushes,
        lost_in_transit: records.iter().map(by_robot).sum::<u32>() + silent.count() as u32,
        wrong_objects: sum(|l| l.wrong_objects),
        disturbed: sum(|l| l.disturbed[0]),
        disturbed_in_bin: sum(|l| l.disturbed[1]),
        rough: (0..world.object_count())
            .filter(|&i| records[i].peak_impulse_n_s > world.object(i).info.harmless_impulse_n_s())
            .count() as u32,
        not_upright: inside.iter().filter(|&&i| !items[i].clauses.upright).count() as u32,
        bad_packs: bad_packs(world, &bodies_inside, settings.resting_n),
        density: density(cell, settings.cell_m, world, &bodies_inside),
        drift_m,
    }
}

fn bad_packs(world: &World, inside: &[usize], resting_n: f64) -> Vec<BadPack> {
    let mut found = Vec::new();
    for &below in inside {
        for &(above, newtons) in &world.contacts(below).loads {
            let (on_top, under) = (&world.object(above).info, &world.object(below).info);
            if newtons >= resting_n && !under.fragility.bears(on_top.mass_kg) {
                found.push(BadPack { above: on_top.name.clone(), below: under.name.clone() });
            }
        }
    }
    found
}

/// How tightly the bin is packed where it is packed at all.
fn density(cell: &Cell, cell_m: f64, world: &World, inside: &[usize]) -> Option<f64> {
    let objects = inside.iter().map(|&i| BelievedObject {
        packed: true,
        ..BelievedObject::new(world.object(i).clone(), world.truth(i))
    });
    let scene = BeliefScene { objects: objects.collect(), ..cell.empty_belief() };
    let (map, _) = bin_map(&scene, cell_m);
    let below: f64 = map.heights.iter().map(|h| h.max(0.0) * cell_m * cell_m).sum();
    let filled: f64 = inside.iter().map(|&i| world.object(i).visual.mesh.volume().abs()).sum();
    (below > 0.0).then(|| filled / below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::tests::empty;
    use crate::setup::Setup;
    use grip_sim::pose::Pose;
    use nalgebra::{Isometry3, Vector3};

    const RESTING_N: f64 = 0.2;

    /// A world with named objects at places in the bin's frame, at rest.
    fn packed(objects: &[(&str, [f64; 3])]) -> (Setup, World) {
        let (setup, mut world) = empty();
        for (name, [x, y, z]) in objects {
            let model = setup.library.load(name).unwrap();
            let at = setup.cell.scene.bin.world_from_bin() * Isometry3::translation(*x, *y, *z);
            world.add_object(model, &Pose::new(at)).unwrap();
        }
        world.settle(3.0);
        (setup, world)
    }

    #[test]
    fn a_can_on_a_foam_brick_is_a_bad_pack_and_beside_it_is_none() {
        let (brick, can) = ("061_foam_brick", "005_tomato_soup_can");
        let (_, world) = packed(&[(brick, [0.0, 0.0, 0.026]), (can, [0.0, 0.0, 0.105])]);
        let expected = BadPack { above: can.into(), below: brick.into() };
        assert_eq!(bad_packs(&world, &[0, 1], RESTING_N), [expected]);
        let (_, world) = packed(&[(brick, [-0.1, 0.0, 0.026]), (can, [0.1, 0.0, 0.052])]);
        assert_eq!(bad_packs(&world, &[0, 1], RESTING_N), []);
    }

    #[test]
    fn a_box_that_stands_fills_the_space_below_its_top() {
        let (setup, world) = packed(&[("036_wood_block", [0.0, 0.0, 0.104])]);
        let dense = density(&setup.cell, 0.005, &world, &[0]).unwrap();
        assert!((0.85..1.15).contains(&dense), "cells of 5 mm on a block of 85 mm: {dense}");
        assert_eq!(density(&setup.cell, 0.005, &world, &[]), None);
    }

    #[test]
    fn a_blow_has_the_momentum_of_the_fall() {
        // 4 cm of fall, standing up: m sqrt(2 g h), half a millimetre of skin aside.
        let (setup, mut world) = empty();
        let block = setup.library.load("036_wood_block").unwrap();
        let at = setup.cell.scene.bin.world_from_bin() * Isometry3::translation(0.0, 0.0, 0.103 + 0.04);
        world.add_object(block.clone(), &Pose::new(at)).unwrap();
        world.reset_peaks();
        world.settle(2.0);
        let expected = block.info.mass_kg * (2.0 * 9.81 * 0.04_f64).sqrt();
        let measured = world.peak_impulse(0);
        assert!((0.85..1.35).contains(&(measured / expected)), "{measured} against {expected} N s");
        assert!(measured < block.info.harmless_impulse_n_s(), "a wood block takes half a metre");
    }

    #[test]
    fn what_moved_is_measured_at_its_farthest_point() {
        let (_, mut world) = packed(&[("005_tomato_soup_can", [0.0, 0.0, 0.052])]);
        let before = world.poses();
        assert!(world.moved_since(&before)[0] < 1e-9);
        world.settle(1.0);
        assert!(world.moved_since(&before)[0] < 1e-3);
        let mut elsewhere = before.clone();
        elsewhere[0] = Pose::new(Isometry3::from_parts(
            (before[0].translation() + Vector3::x() * 0.03).into(),
            before[0].rotation(),
        ));
        assert!((world.moved_since(&elsewhere)[0] - 0.03).abs() < 1e-3);
    }
}
