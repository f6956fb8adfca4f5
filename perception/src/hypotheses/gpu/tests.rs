//! The shader against the CPU, pose by pose.

use std::sync::LazyLock;

use super::*;
use grip_testkit::meshes;

use crate::hypotheses::tests::{observe, placed};
use crate::hypotheses::{Cpu, HypothesisRenderer, HypothesisRendererChoice};
use crate::model::Model;
use crate::model::fixtures::{model, skew_box, sphere};
use crate::observation::{Observation, Stride};
use crate::support::Plane;

static SHARED: LazyLock<Result<Arc<GpuRenderer>>> = LazyLock::new(|| GpuRenderer::open().map(Arc::new));

/// A session on the adapter; `None`, visibly, where there is none, which `GRIP_REQUIRE_ADAPTER=1` forbids.
fn gpu_or_skip(test: &str) -> Option<Gpu> {
    match &*SHARED {
        Ok(renderer) => Some(Gpu::new(renderer.clone())),
        Err(error) => {
            assert!(
                std::env::var_os("GRIP_REQUIRE_ADAPTER").is_none_or(|v| v != "1"),
                "GRIP_REQUIRE_ADAPTER=1, but {error}"
            );
            println!("SKIPPED {test}: {error}");
            None
        }
    }
}

fn cup() -> Model {
    model(meshes::cup())
}

fn batch<'a>(model: &'a Model, observation: &'a Observation, stride: Stride) -> Batch<'a> {
    Batch {
        lod: model.lod(500),
        radius: model.radius,
        observation,
        stride,
        kernel: 2.0,
        steps: 0,
        damping: 0.01,
        converged_m: 0.0,
    }
}

/// In view, over each border, small, large, and where nothing can be rendered.
fn poses(truth: &Isometry3<f32>) -> Vec<Isometry3<f32>> {
    let mut poses = vec![*truth];
    for i in 0..24 {
        let x = i as f32;
        let near = Vector3::new(0.01 * x.sin(), 0.01 * x.cos(), 0.003 * (x - 12.0));
        poses.push(placed(
            truth.translation.x + near.x,
            truth.translation.y + near.y,
            truth.translation.z + near.z,
            Vector3::new(x, 0.3 * x, 0.1),
        ));
    }
    for (x, y, z) in [
        (0.55, 0.0, 1.0),
        (-0.6, 0.1, 1.0),
        (0.0, 0.45, 1.0),
        (0.1, -0.42, 1.0),
        (0.58, 0.43, 1.0),
        (0.0, 0.0, 0.3),
        (0.05, 0.02, 0.2),
        (0.1, 0.1, 3.0),
        (0.1, 0.1, 40.0),
        // Through the lens, behind the camera, beside the image, not a number.
        (0.0, 0.0, 0.06),
        (0.0, 0.0, -1.0),
        (5.0, 0.0, 1.0),
        (0.0, -3.0, 1.0),
        (1e30, 0.0, 1.0),
        (0.0, 0.0, f32::NAN),
        (f32::NAN, 0.0, 1.0),
        (0.0, f32::INFINITY, 1.0),
    ] {
        poses.push(placed(x, y, z, Vector3::new(0.4, -0.8, 0.3)));
    }
    let mut broken = *truth;
    broken.rotation = UnitQuaternion::new_unchecked(Quaternion::new(f32::NAN, 0.0, 0.0, 1.0));
    poses.push(broken);
    poses
}

fn assert_close(name: &str, gpu: f32, cpu: f32, context: &str) {
    let slack = 2.0 + 0.005 * cpu.abs();
    assert!((gpu - cpu).abs() <= slack, "{name}: {gpu} on the GPU, {cpu} on the CPU; {context}");
}

fn assert_alike(gpu: &Option<Rendered>, cpu: &Option<Rendered>, context: &str) {
    let (Some(gpu), Some(cpu)) = (gpu, cpu) else {
        assert_eq!(gpu.is_some(), cpu.is_some(), "{context}");
        return;
    };
    let (a, b) = (&gpu.terms, &cpu.terms);
    assert_close("rendered", a.rendered, b.rendered, context);
    assert_close("hole", a.hole, b.hole, context);
    assert_close("occluded", a.occluded, b.occluded, context);
    assert_close("violated", a.violated, b.violated, context);
    assert_close("fit", a.fit, b.fit, context);
    assert_close("rim", a.rim, b.rim, context);
    assert_close("edge", a.edge, b.edge, context);
    for (a, b) in gpu.extent.bounds.iter().zip(cpu.extent.bounds) {
        assert!((a - b).abs() < 1e-2, "bounds {:?} and {:?}; {context}", gpu.extent, cpu.extent);
    }
    let (a, b) = (gpu.extent.lowest, cpu.extent.lowest);
    assert!((a - b).abs() < 1e-4, "lowest {a} on the GPU, {b} on the CPU; {context}");
}

#[test]
fn the_shader_is_valid() {
    let module = naga::front::wgsl::parse_str(SHADER)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(SHADER)));
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(SHADER)));
}

#[test]
fn auto_takes_no_software() {
    match HypothesisRenderer::open(HypothesisRendererChoice::Auto).unwrap() {
        HypothesisRenderer::Cpu => {}
        HypothesisRenderer::Gpu(renderer) => assert!(!renderer.device.software, "{}", renderer.info()),
    }
    assert_eq!(HypothesisRenderer::default().to_string(), "cpu");
}

#[test]
fn terms_and_extents_are_those_of_the_cpu() {
    let Some(mut gpu) = gpu_or_skip("terms_and_extents_are_those_of_the_cpu") else { return };
    for (name, model) in [
        ("box", skew_box([0.06, 0.09, 0.14])),
        ("large box", skew_box([0.3, 0.25, 0.2])),
        ("sphere", sphere(0.05)),
        ("cup", cup()),
    ] {
        let truth = placed(0.02, 0.03, 0.9, Vector3::new(0.5, 0.4, 0.3));
        let mut observation = observe(&model, &truth);
        observation.stand_on(Plane { normal: -Vector3::y_axis(), offset: 0.1 });
        let mut seen = 0;
        for stride in Stride::ALL {
            let batch = batch(&model, &observation, stride);
            let (mut a, mut b) = (poses(&truth), poses(&truth));
            let on_gpu = gpu.advance(&batch, &mut a).unwrap();
            let mut cpu = Cpu::default();
            let on_cpu = cpu.advance(&batch, &mut b).unwrap();
            assert_eq!(on_gpu.len(), on_cpu.len());
            for (i, (x, y)) in on_gpu.iter().zip(on_cpu).enumerate() {
                assert_alike(x, y, &format!("{name}, stride {stride}, pose {i}"));
                seen += usize::from(x.is_some());
            }
            // Poses that are not moved stay as they are, to the bit.
            assert_eq!(format!("{a:?}"), format!("{b:?}"));
        }
        assert!(seen > 4 * 25, "{seen} of the poses are in view");
    }
}

#[test]
fn holes_and_occluders_are_those_of_the_cpu() {
    let Some(mut gpu) = gpu_or_skip("holes_and_occluders_are_those_of_the_cpu") else { return };
    let model = skew_box([0.06, 0.09, 0.14]);
    let truth = placed(0.02, 0.03, 0.9, Vector3::new(0.5, 0.4, 0.3));
    let whole = observe(&model, &truth);
    let marks: Vec<bool> = (0..whole.level(Stride::Two).w.len()).map(|i| i % 7 < 2).collect();
    // The same session first sees the one, then the other: what was uploaded must not be mixed up.
    for observation in [&whole, &whole.without(&marks)] {
        for stride in Stride::ALL {
            let batch = batch(&model, observation, stride);
            let on_gpu = gpu.advance(&batch, &mut poses(&truth)).unwrap();
            let mut cpu = Cpu::default();
            let on_cpu = cpu.advance(&batch, &mut poses(&truth)).unwrap();
            for (i, (x, y)) in on_gpu.iter().zip(on_cpu).enumerate() {
                assert_alike(x, y, &format!("stride {stride}, pose {i}"));
            }
        }
    }
}

/// Software and hardware adapters run workgroups of different sizes: what runs here must be right on the others.
#[test]
fn workgroups_of_any_size_agree() {
    let Some(mut gpu) = gpu_or_skip("workgroups_of_any_size_agree") else { return };
    let model = cup();
    let truth = placed(0.02, 0.03, 0.5, Vector3::new(0.5, 0.4, 0.3));
    let observation = observe(&model, &truth);
    let batch = Batch { steps: 3, ..batch(&model, &observation, Stride::One) };
    let mut expected = poses(&truth)[..8].to_vec();
    let terms = gpu.advance(&batch, &mut expected).unwrap().to_vec();
    for (threads, steps) in [(64, 16), (128, 2), (256, 1)] {
        let renderer = GpuRenderer::new(Device::open().unwrap(), threads, steps).unwrap();
        let mut moved = poses(&truth)[..8].to_vec();
        let rendered = Gpu::new(Arc::new(renderer)).advance(&batch, &mut moved).unwrap().to_vec();
        for (i, (a, b)) in moved.iter().zip(&expected).enumerate() {
            assert!(
                (a.translation.vector - b.translation.vector).norm() < 1e-4,
                "{threads} threads, pose {i}"
            );
            assert!(a.rotation.angle_to(&b.rotation) < 1e-4, "{threads} threads, pose {i}");
            assert_alike(&rendered[i], &terms[i], &format!("{threads} threads, pose {i}"));
        }
    }
}

#[test]
fn steps_end_where_those_of_the_cpu_do() {
    let Some(mut gpu) = gpu_or_skip("steps_end_where_those_of_the_cpu_do") else { return };
    let model = skew_box([0.06, 0.09, 0.14]);
    for turn in [Vector3::new(0.5, 0.4, 0.3), Vector3::new(-1.0, 0.7, 2.0), Vector3::new(2.5, -0.3, 0.4)] {
        let truth = placed(0.02, 0.03, 0.9, turn);
        let observation = observe(&model, &truth);
        let start: Vec<Isometry3<f32>> = (0..12)
            .map(|i| {
                let x = i as f32;
                let shift = 0.004 * Vector3::new(x.sin(), x.cos(), (2.0 * x).sin());
                let tilt = 0.04 * Vector3::new((3.0 * x).cos(), x.sin(), (2.0 * x).cos());
                Isometry3::from_parts(
                    Translation3::from(truth.translation.vector + shift),
                    UnitQuaternion::from_scaled_axis(tilt) * truth.rotation,
                )
            })
            .collect();
        for (stride, steps, converged_m) in
            [(Stride::One, 1, 0.0), (Stride::One, 8, 1e-4), (Stride::Two, 3, 0.0), (Stride::Four, 2, 0.0)]
        {
            let batch = Batch { steps, converged_m, ..batch(&model, &observation, stride) };
            let (mut a, mut b) = (start.clone(), start.clone());
            gpu.advance(&batch, &mut a).unwrap();
            Cpu::default().advance(&batch, &mut b).unwrap();
            let mut moved = 0.0f32;
            for (i, (x, y)) in a.iter().zip(&b).enumerate() {
                let shift = (x.translation.vector - y.translation.vector).norm();
                let turn = x.rotation.angle_to(&y.rotation);
                assert!(shift < 1e-4, "stride {stride}, {steps} steps, pose {i}: {shift} m apart");
                assert!(turn < 1e-4, "stride {stride}, {steps} steps, pose {i}: {turn} rad apart");
                assert!((x.rotation.norm() - 1.0).abs() < 1e-5);
                moved = moved.max((x.translation.vector - start[i].translation.vector).norm());
            }
            assert!(moved > 1e-3, "nothing moved");
        }
    }
}

#[test]
fn poses_that_cannot_be_rendered_are_not_moved() {
    let Some(mut gpu) = gpu_or_skip("poses_that_cannot_be_rendered_are_not_moved") else { return };
    let model = sphere(0.05);
    let truth = placed(0.02, 0.03, 0.9, Vector3::zeros());
    let observation = observe(&model, &truth);
    let batch = Batch { steps: 4, ..batch(&model, &observation, Stride::Two) };
    let mut before = poses(&truth);
    before.push(placed(0.0, 0.0, f32::INFINITY, Vector3::zeros()));
    let mut after = before.clone();
    let rendered = gpu.advance(&batch, &mut after).unwrap();
    for ((a, b), rendered) in after.iter().zip(&before).zip(rendered) {
        if rendered.is_none() {
            assert_eq!(format!("{a:?}"), format!("{b:?}"));
        } else {
            assert!(a.translation.vector.iter().chain(a.rotation.coords.iter()).all(|x| x.is_finite()));
        }
    }
    assert!(gpu.advance(&batch, &mut []).unwrap().is_empty());
}

/// Lavapipe ends loops after 65535 turns: steps in dispatches of their own stay below that, and where they do not,
/// there is an error and no wrong result.
#[test]
fn a_large_hypothesis_is_whole_or_an_error() {
    let Some(mut gpu) = gpu_or_skip("a_large_hypothesis_is_whole_or_an_error") else { return };
    let model = sphere(0.19);
    let truth = placed(0.0, 0.0, 0.5, Vector3::zeros());
    let observation = observe(&model, &truth);
    let start = placed(0.002, 0.0, 0.503, Vector3::zeros());
    let batch = Batch { steps: 6, lod: model.lod(1000), ..batch(&model, &observation, Stride::One) };
    let (mut a, mut b) = ([start], [start]);
    let mut cpu = Cpu::default();
    let expected = cpu.advance(&batch, &mut b).unwrap()[0];
    assert!(expected.unwrap().terms.rendered > 150_000.0);
    assert_alike(&gpu.advance(&batch, &mut a).unwrap()[0], &expected, "split");
    assert!((a[0].translation.vector - b[0].translation.vector).norm() < 1e-4);
    let fused = GpuRenderer::new(Device::open().unwrap(), SOFTWARE_THREADS, MOST_STEPS).unwrap();
    match Gpu::new(Arc::new(fused)).advance(&batch, &mut [start]) {
        Ok(rendered) => assert_alike(&rendered[0], &expected, "fused"),
        Err(error) => {
            println!("{error}");
            assert!(error.to_string().contains("gave up"), "{error}");
        }
    }
}

fn bits(poses: &[Isometry3<f32>], rendered: &[Option<Rendered>]) -> Vec<u32> {
    let mut out = Vec::new();
    for (pose, rendered) in poses.iter().zip(rendered) {
        out.extend(pose.translation.vector.iter().chain(pose.rotation.coords.iter()).map(|x| x.to_bits()));
        if let Some(Rendered { terms: t, extent: e }) = rendered {
            let terms = [t.rendered, t.hole, t.occluded, t.violated, t.fit, t.rim, t.edge, e.lowest];
            out.extend(terms.iter().chain(&e.bounds).map(|x| x.to_bits()));
        }
    }
    out
}

/// Also in a larger batch, in which each pose has another place, and in another session at the same time.
#[test]
fn the_same_bits_twice_and_in_parallel() {
    let Some(gpu) = gpu_or_skip("the_same_bits_twice_and_in_parallel") else { return };
    let (model, other) = (cup(), skew_box([0.06, 0.09, 0.14]));
    let truth = placed(0.02, 0.03, 0.9, Vector3::new(0.5, 0.4, 0.3));
    let observation = observe(&model, &truth);
    let run = |gpu: &mut Gpu, stride: Stride, model: &Model| {
        let batch = Batch { steps: 3, ..batch(model, &observation, stride) };
        let mut moved = poses(&truth);
        let rendered = gpu.advance(&batch, &mut moved).unwrap();
        bits(&moved, rendered)
    };
    let renderer = gpu.renderer;
    let mut first = Gpu::new(renderer.clone());
    let (one, four) = (run(&mut first, Stride::One, &model), run(&mut first, Stride::Four, &other));
    assert_eq!(one, run(&mut first, Stride::One, &model));
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let mut gpu = Gpu::new(renderer.clone());
                for _ in 0..4 {
                    assert_eq!(one, run(&mut gpu, Stride::One, &model));
                    assert_eq!(four, run(&mut gpu, Stride::Four, &other));
                }
            });
        }
    });
    let batch = Batch { steps: 3, ..batch(&model, &observation, Stride::Eight) };
    let mut few = poses(&truth);
    let mut many: Vec<_> = few.iter().copied().cycle().take(MOST_POSES + 100).collect();
    let rendered = first.advance(&batch, &mut few).unwrap().to_vec();
    let few = bits(&few, &rendered);
    let rendered = first.advance(&batch, &mut many).unwrap();
    assert_eq!(rendered.len(), many.len());
    let (head, tail) = (poses(&truth).len(), MOST_POSES.next_multiple_of(poses(&truth).len()));
    assert_eq!(few, bits(&many[..head], &rendered[..head]));
    let whole = tail..(tail + head).min(many.len());
    let last = bits(&many[whole.clone()], &rendered[whole]);
    assert_eq!(few[..last.len()], last);
}

#[test]
fn a_lost_device_is_an_error() {
    if gpu_or_skip("a_lost_device_is_an_error").is_none() {
        return;
    }
    let model = sphere(0.05);
    let truth = placed(0.02, 0.03, 0.9, Vector3::zeros());
    let observation = observe(&model, &truth);
    let batch = batch(&model, &observation, Stride::Four);
    // Not the one that the other tests share.
    let mut gpu = Gpu::new(Arc::new(GpuRenderer::open().unwrap()));
    assert!(gpu.advance(&batch, &mut [truth]).unwrap()[0].is_some());
    gpu.renderer.device.device.destroy();
    for stride in [Stride::Four, Stride::Two] {
        let error = gpu.advance(&Batch { stride, ..batch }, &mut [truth]).unwrap_err();
        assert!(error.to_string().contains("--hypotheses cpu"), "{error}");
    }
    let mut other = Gpu::new(gpu.renderer.clone());
    assert!(other.advance(&batch, &mut [truth]).is_err());
}
