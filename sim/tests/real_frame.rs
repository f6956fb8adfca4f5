//! A real frame of YCB-Video: the models drawn at their true poses lie on the real depth as closely as truth and sensor do.
//! Its residuals are millimetres (the cracker box's up to 8), because pose and depth of the data set disagree by that much.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, missing_docs)]

use grip_sim::bop::Dataset;
use grip_sim::render::silhouette;
use grip_testkit::data::data;

#[test]
fn models_at_their_true_poses_lie_on_the_real_depth() {
    let Some(root) = data("ycbv-real-frame") else { return };
    let dataset = Dataset::open(&root, None).unwrap();
    let frame = dataset.frame(50, 1).unwrap();
    assert_eq!(frame.truth().unwrap().len(), 5);
    for truth in frame.truth().unwrap() {
        let model = dataset.load_model(truth.obj_id).unwrap();
        let drawn = silhouette(&model.mesh, &truth.camera_from_object, &frame.intrinsics).unwrap();
        let mut residuals_mm: Vec<f64> = Vec::new();
        for y in 0..drawn.mask.height() {
            for x in 0..drawn.mask.width() {
                let (u, v) = (x as i32 + drawn.offset[0], y as i32 + drawn.offset[1]);
                let inside = u >= 0
                    && v >= 0
                    && (u as usize) < frame.intrinsics.width
                    && (v as usize) < frame.intrinsics.height;
                let inverse = f64::from(*drawn.inverse_depth.at(x, y));
                if !inside || inverse == 0.0 {
                    continue;
                }
                let real = f64::from(*frame.depth.at(u as usize, v as usize));
                let residual = real - 1.0 / inverse;
                // Others stand before parts of some objects; what lies within 3 cm is the object itself.
                if real > 0.0 && residual.abs() < 0.03 {
                    residuals_mm.push(1e3 * residual);
                }
            }
        }
        residuals_mm.sort_by(f64::total_cmp);
        let median = residuals_mm[residuals_mm.len() / 2];
        let mut spread: Vec<f64> = residuals_mm.iter().map(|r| (r - median).abs()).collect();
        spread.sort_by(f64::total_cmp);
        let deviation = spread[spread.len() / 2];
        println!(
            "object {:2}: {:5} pixels, median {median:+.1} mm, median deviation {deviation:.1} mm",
            truth.obj_id,
            residuals_mm.len()
        );
        assert!(residuals_mm.len() > 1000);
        assert!(median.abs() < 8.0 && deviation < 5.0, "object {}", truth.obj_id);
    }
}
