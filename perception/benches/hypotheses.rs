//! Speed of hypotheses, of the paper's iteration and of whole poses, by object and instruction set.
//!
//! `cargo bench -p grip-perception --features bench --bench hypotheses`; objects are 0.95 m from the camera, as in most figures of the
//! literature, unless said.
#![expect(clippy::unwrap_used, reason = "a bench")]

use std::path::Path;
use std::sync::Arc;

use divan::{Bencher, counter::ItemsCount};
use grip_perception::hypotheses::Cpu;
use grip_perception::observation::Stride;
use grip_perception::workbench::Workbench;
use grip_perception::{
    GripEstimator, HypothesisRenderer, HypothesisRendererChoice, PaperSettings, PoseEstimator,
};
use grip_sim::objects::{ObjectLibrary, ObjectModel, ObjectSet};

fn main() {
    divan::main();
}

const OBJECTS: [&str; 6] = [
    "003_cracker_box",
    "005_tomato_soup_can",
    "006_mustard_bottle",
    "011_banana",
    "025_mug",
    "040_large_marker",
];
const DISTANCE_M: f32 = 0.95;
/// Hypotheses an iteration of the paper.
const SAMPLES: usize = 625;

fn object(name: &str) -> Arc<ObjectModel> {
    let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
    ObjectLibrary::open(&table, ObjectSet::BuiltIn).unwrap().load(name).unwrap()
}

fn bench(name: &str) -> Workbench {
    Workbench::new(&object(name), DISTANCE_M, SAMPLES).unwrap()
}

/// Constants of a function cannot be of our own type.
fn stride(pixels: usize) -> Stride {
    Stride::ALL[pixels.trailing_zeros() as usize]
}

/// Drawing alone, 500 triangles at full resolution, one thread; each instruction set.
#[divan::bench(args = [0, 1, 2])]
fn render_soup_can(bencher: Bencher<'_, '_>, isa: usize) {
    let bench = bench("005_tomato_soup_can");
    let Some(isa) = Workbench::isas().get(isa).copied() else { return };
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| bench.render(isa, Stride::One, 500));
}

/// Drawing and comparing, one thread: stride and triangles of the levels.
#[divan::bench(args = OBJECTS, consts = [1, 2, 4, 8])]
fn weigh<const STRIDE: usize>(bencher: Bencher<'_, '_>, name: &str) {
    let bench = bench(name);
    let triangles = [1000, 200, 200, 60][STRIDE.trailing_zeros() as usize];
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| bench.advance(&mut Cpu::default(), stride(STRIDE), triangles, 0));
}

/// A Gauss-Newton step before it.
#[divan::bench(args = OBJECTS, consts = [1, 2, 4, 8])]
fn move_and_weigh<const STRIDE: usize>(bencher: Bencher<'_, '_>, name: &str) {
    let bench = bench(name);
    let triangles = [1000, 200, 200, 60][STRIDE.trailing_zeros() as usize];
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| bench.advance(&mut Cpu::default(), stride(STRIDE), triangles, 1));
}

/// A step, drawing and comparing on the graphics adapter, a software driver where there is no other; nothing without one.
#[divan::bench(consts = [1, 2, 4], sample_count = 10)]
fn gpu_soup_can<const STRIDE: usize>(bencher: Bencher<'_, '_>) {
    let Ok(gpu) = HypothesisRenderer::open(HypothesisRendererChoice::Gpu) else { return };
    let (bench, mut session) = (bench("005_tomato_soup_can"), gpu.session());
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| bench.advance(&mut *session, stride(STRIDE), 200, 1).unwrap());
}

/// One iteration of the paper: 625 hypotheses, full likelihood, full resolution; one and two threads.
#[divan::bench(args = OBJECTS, consts = [1, 2])]
fn paper_iteration<const THREADS: usize>(bencher: Bencher<'_, '_>, name: &str) {
    let bench = bench(name);
    let settings = PaperSettings::default();
    let paper = bench.paper(&settings);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap();
    bencher.bench_local(|| pool.install(|| paper.iteration()));
}

/// A whole pose with the preparation of its frame, one and two threads.
#[divan::bench(args = OBJECTS, consts = [1, 2], sample_count = 20)]
fn pose<const THREADS: usize>(bencher: Bencher<'_, '_>, name: &str) {
    let (bench, objects) = (bench(name), [object(name)]);
    let estimator = GripEstimator::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap();
    let mut seed = 0;
    bencher.bench_local(|| {
        seed += 1;
        pool.install(|| estimator.estimate(&bench.frame, &bench.detections, &objects, seed)).unwrap()
    });
}

/// A frame of six objects with its preparation, one and two threads.
#[divan::bench(consts = [1, 2], sample_count = 20)]
fn frame_of_six<const THREADS: usize>(bencher: Bencher<'_, '_>) {
    let objects = OBJECTS.map(object);
    let (frame, detections) = Workbench::together(&objects, DISTANCE_M).unwrap();
    let estimator = GripEstimator::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap();
    let mut seed = 0;
    bencher.bench_local(|| {
        seed += 1;
        pool.install(|| estimator.estimate(&frame, &detections, &objects, seed)).unwrap()
    });
}
