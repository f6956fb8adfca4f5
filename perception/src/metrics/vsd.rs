//! VSD: the share of what is seen of an object that an estimate explains wrongly (Hodan et al., "BOP Challenge 2020 on 6D
//! Object Localization", 2020, equation 2), with masks and cost as in the challenge since 2019.

use grip_sim::bop::VISIBLE_M;
use grip_sim::camera::Intrinsics;
use grip_sim::images::DepthImage;
use grip_sim::render::ObjectDepth;

/// Visible surface discrepancy, one for each misalignment tolerance (metres), each 0 to 1.
///
/// `measured` is the camera's depth image, `truth` and `estimate` are the object alone, rendered at the two poses; all three
/// of one camera, metres along its axis. What is compared are distances from the camera's centre.
///
/// * A pixel shows the truth where it is rendered and at most [`VISIBLE_M`] behind what was measured. The same holds for the
///   estimate, which also shows wherever it covers a pixel that shows the truth.
/// * Where nothing was measured (0, or no number) nothing hides either.
/// * The cost of a pixel that shows one of the two is 1, of one that shows both 1 where they are apart by the tolerance or
///   more, else 0. The discrepancy is the mean cost; 1 where no pixel shows either.
pub fn vsd<const N: usize>(
    measured: &DepthImage,
    truth: &ObjectDepth,
    estimate: &ObjectDepth,
    intrinsics: &Intrinsics,
    tolerances_m: &[f64; N],
) -> [f64; N] {
    let (mut either, mut one) = (0_usize, 0_usize);
    let mut apart = [0_usize; N];
    // The rectangle about both, within the image.
    let range = |axis: usize, size: usize| {
        let sides = [truth, estimate].map(|o| [o.offset[axis], o.offset[axis] + o.size()[axis]]);
        sides[0][0].min(sides[1][0])..sides[0][1].max(sides[1][1]).min(size)
    };
    for v in range(1, measured.height()) {
        for u in range(0, measured.width()) {
            let (of_truth, of_estimate) = (truth.at(u, v), estimate.at(u, v));
            if of_truth <= 0.0 && of_estimate <= 0.0 {
                continue;
            }
            // Distance over depth.
            let ray = intrinsics.back_project(u as f64, v as f64, 1.0).coords.norm();
            let distance = |depth: f32| f64::from(depth) * ray;
            let measured = measured.at(u, v);
            // Written so that NaN is a hole.
            let hidden = |depth: f32| *measured > 0.0 && distance(depth) - distance(*measured) > VISIBLE_M;
            let shows_truth = of_truth > 0.0 && !hidden(of_truth);
            let shows_estimate = of_estimate > 0.0 && (shows_truth || !hidden(of_estimate));
            either += usize::from(shows_truth || shows_estimate);
            one += usize::from(shows_truth != shows_estimate);
            if shows_truth && shows_estimate {
                let off = (distance(of_truth) - distance(of_estimate)).abs();
                for (apart, tolerance) in apart.iter_mut().zip(tolerances_m) {
                    *apart += usize::from(off >= *tolerance);
                }
            }
        }
    }
    apart.map(|apart| if either == 0 { 1.0 } else { (apart + one) as f64 / either as f64 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::mesh::Mesh;
    use grip_sim::pose::Pose;
    use grip_sim::render::object_depth;
    use nalgebra::{Point3, Vector3};

    // Rays are nearly parallel, so that distances are depths to a thousandth.
    const K: Intrinsics = Intrinsics { width: 100, height: 80, fx: 1000.0, fy: 1000.0, cx: 49.5, cy: 39.5 };
    const TOLERANCES: [f64; 3] = [0.005, 0.01, 0.02];

    /// A plate across the view, 40 by 20 pixels at a metre, moved by this much.
    fn plate(shift: [f64; 3]) -> ObjectDepth {
        let corner = |x: f32, y: f32| Point3::new(0.02 * x, 0.01 * y, 0.0);
        let mesh = Mesh {
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            normals: vec![-Vector3::z(); 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let [x, y, z] = shift;
        object_depth(&mesh, &Pose::from_xyz_rpy([x, y, 1.0 + z], [0.0; 3]), &K)
    }

    fn wall(depth: f32) -> DepthImage {
        DepthImage::filled(K.width, K.height, depth)
    }

    /// A wall a metre and a half away with what stands before it.
    fn scene(objects: &[&ObjectDepth]) -> DepthImage {
        let mut seen = wall(1.5);
        for v in 0..K.height {
            for u in 0..K.width {
                for depth in objects.iter().map(|o| o.at(u, v)).filter(|depth| *depth > 0.0) {
                    *seen.at_mut(u, v) = seen.at(u, v).min(depth);
                }
            }
        }
        seen
    }

    #[test]
    fn the_truth_has_none_and_another_place_has_all() {
        let truth = plate([0.0; 3]);
        let seen = scene(&[&truth]);
        assert_eq!(vsd(&seen, &truth, &truth, &K, &TOLERANCES), [0.0; 3]);
        for shift in [[0.041, 0.0, 0.0], [0.0, -0.025, 0.0], [9.0, 0.0, 0.0], [0.0, 0.0, -3.0]] {
            assert_eq!(vsd(&seen, &truth, &plate(shift), &K, &TOLERANCES), [1.0; 3], "{shift:?}");
        }
        // Nothing of either in the picture.
        let nothing = plate([9.0, 0.0, 0.0]);
        assert_eq!(vsd(&seen, &nothing, &nothing, &K, &TOLERANCES), [1.0; 3]);
    }

    #[test]
    fn a_shift_along_the_view_costs_where_it_is_not_tolerated() {
        let truth = plate([0.0; 3]);
        let seen = scene(&[&truth]);
        // 8 mm nearer or farther, in whole pixels as large: between the first two tolerances.
        for z in [-0.008, 0.008] {
            assert_eq!(vsd(&seen, &truth, &plate([0.0, 0.0, z]), &K, &TOLERANCES), [1.0, 0.0, 0.0]);
        }
        // 18 mm farther: behind what was measured by more than delta, but the truth is seen there.
        assert_eq!(vsd(&seen, &truth, &plate([0.0, 0.0, 0.018]), &K, &TOLERANCES), [1.0, 1.0, 0.0]);
    }

    #[test]
    fn a_shift_aside_costs_what_does_not_overlap() {
        let truth = plate([0.0; 3]);
        let seen = scene(&[&truth]);
        // 40 columns each, 30 of them in common: 20 of 50, if the new ones could be seen. The wall behind does not hide.
        assert_eq!(vsd(&seen, &truth, &plate([0.01, 0.0, 0.0]), &K, &TOLERANCES), [20.0 / 50.0; 3]);
        // What stands beside the truth, nearer, hides the 10 new columns: 10 of 40.
        let beside = plate([0.038, 0.0, -0.1]);
        let seen = scene(&[&truth, &beside]);
        assert_eq!([69, 70, 79].map(|u| beside.at(u, 40) > 0.0), [false, true, true]);
        assert_eq!(vsd(&seen, &truth, &plate([0.01, 0.0, 0.0]), &K, &TOLERANCES), [10.0 / 40.0; 3]);
    }

    #[test]
    fn what_is_hidden_from_the_camera_does_not_count() {
        let truth = plate([0.0; 3]);
        let seen = scene(&[&truth]);
        // All is hidden behind a wall in front.
        assert_eq!(vsd(&wall(0.9), &truth, &truth, &K, &TOLERANCES), [1.0; 3]);
        // A wall 14 mm before the object does not hide it, one of 16 mm does.
        assert_eq!(vsd(&wall(0.986), &truth, &truth, &K, &TOLERANCES), [0.0; 3]);
        assert_eq!(vsd(&wall(0.984), &truth, &truth, &K, &TOLERANCES), [1.0; 3]);
        // The left half is covered by something near: what the estimate has wrong there costs nothing.
        let mut covered = seen.clone();
        let near = |image: &mut DepthImage, columns: std::ops::Range<usize>| {
            (0..K.height).for_each(|v| columns.clone().for_each(|u| *image.at_mut(u, v) = 0.5));
        };
        near(&mut covered, 0..50);
        // Shifted by 10 columns to the left: 20 columns of the truth are seen, 10 of these are left by the estimate.
        let left = plate([-0.01, 0.0, 0.0]);
        assert_eq!(vsd(&covered, &truth, &left, &K, &TOLERANCES), [0.5; 3]);
    }

    #[test]
    fn where_nothing_was_measured_nothing_hides() {
        let truth = plate([0.0; 3]);
        for hole in [0.0, f32::NAN, -1.0] {
            let seen = wall(hole);
            assert_eq!(vsd(&seen, &truth, &truth, &K, &TOLERANCES), [0.0; 3]);
            assert_eq!(vsd(&seen, &truth, &plate([0.01, 0.0, 0.0]), &K, &TOLERANCES), [20.0 / 50.0; 3]);
            assert_eq!(vsd(&seen, &truth, &plate([0.0, 0.0, 0.018]), &K, &TOLERANCES), [1.0, 1.0, 0.0]);
        }
    }
}
