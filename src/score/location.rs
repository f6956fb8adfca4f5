//! Where items are, and which of them were knocked out.

use grip_physics::World;
use grip_sim::scene::Scene;
use nalgebra::Point3;

use crate::settings::SuccessCriteria;

/// Where an item is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// On the table.
    Table,
    /// In the bin.
    Bin,
    /// On the floor or anywhere else.
    Lost,
}

/// Where all items are.
pub fn locations(world: &World, scene: &Scene, criteria: &SuccessCriteria) -> Vec<Location> {
    let of = |i| {
        let p = world.truth(i).translation();
        let fallen = world.lowest_point(i) < scene.table.height - criteria.fallen_m;
        if in_bin(world, scene, i) {
            Location::Bin
        } else if scene.table.holds(p.x, p.y) && !fallen {
            Location::Table
        } else {
            Location::Lost
        }
    };
    (0..world.object_count()).map(of).collect()
}

/// Items other than `handled` that left the table for the floor, or the bin for anywhere.
pub fn knocked_out(before: &[Location], after: &[Location], handled: usize) -> Vec<usize> {
    (0..before.len())
        .filter(|&i| i != handled && before[i] != Location::Lost)
        .filter(|&i| after[i] == Location::Lost || (before[i] == Location::Bin && after[i] != Location::Bin))
        .collect()
}

/// Whether object `index` is inside the bin: the centre of its bounding box between the walls, its lowest point below
/// their edge, and nothing touched but the bin and other objects. An item across the rim or held by the robot is not.
///
/// This is the one predicate of the score. What the robot believes to be in the bin it can judge by the estimated pose
/// alone ([`grip_sim::scene::Bin::contains`]).
pub fn in_bin(world: &World, scene: &Scene, index: usize) -> bool {
    let centre = Point3::from(world.truth(index).translation());
    scene.bin.contains(&centre, world.object(index).diameter / 2.0)
        && below_edge_m(world, scene, index) > 0.0
        && !world.touches_beside_bin(index)
        && !world.contacts(index).touched_by_robot()
}

/// How far the lowest point of object `index` lies below the edge of the bin's walls, metres.
pub fn below_edge_m(world: &World, scene: &Scene, index: usize) -> f64 {
    scene.bin.world_from_bin().translation.z + scene.bin.wall_height - world.lowest_point(index)
}

#[cfg(test)]
mod tests {
    use super::Location::{Bin, Lost, Table};
    use super::*;
    use crate::score::tests::empty;
    use grip_sim::pose::Pose;
    use nalgebra::{Isometry3, UnitQuaternion, Vector3};

    /// Drops the scene's soup can at a point of the bin's frame, at rest above it, and lets it settle.
    fn can_at(x: f64, y: f64, z: f64) -> (bool, Location) {
        let (setup, mut world) = empty();
        let scene = &setup.cell.scene;
        let can = setup.models.iter().find(|m| m.info.name == "005_tomato_soup_can").unwrap();
        let at = scene.bin.world_from_bin() * Isometry3::translation(x, y, z);
        world.add_object(can.clone(), &Pose::new(at)).unwrap();
        world.settle(3.0);
        (in_bin(&world, scene, 0), locations(&world, scene, &setup.settings.success)[0])
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
        let bin = &setup.cell.scene.bin;
        let lying = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let at = [bin.inner[0] / 2.0 - 0.01, 0.0, bin.wall_height + 0.05];
        let on_rim = Isometry3::from_parts(at.into(), lying);
        world.add_object(sugar.clone(), &Pose::new(bin.world_from_bin() * on_rim)).unwrap();
        assert!(!in_bin(&world, &setup.cell.scene, 0), "its lowest point is above the edge");
    }

    #[test]
    fn knocked_out_means_off_the_table_or_out_of_the_bin() {
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Bin, Table, Bin], 0), Vec::<usize>::new());
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Bin, Lost, Bin], 0), vec![1]);
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Table, Table, Table], 0), vec![2]);
        // What is handled itself is judged by its own clauses.
        assert_eq!(knocked_out(&[Table], &[Lost], 0), Vec::<usize>::new());
    }
}
