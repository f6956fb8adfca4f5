//! The renderers against closed forms, against each other, and against the sensor's contract.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, missing_docs)]

use std::path::Path;
use std::sync::Arc;

use grip_sim::camera::Intrinsics;
use grip_sim::condition::ConditionSpec;
use grip_sim::images::Image;
use grip_sim::mesh::{Material, Mesh};
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::render::cpu::CpuRenderer;
use grip_sim::render::wgpu::WgpuRenderer;
use grip_sim::render::{Instance, Light, Lighting, RenderScene, Renderer, RendererChoice, Rendering, open};
use grip_sim::sensor::{Sensors, capture};
use grip_testkit::cameras::{at, head_camera};
use grip_testkit::textured::{cuboid, sphere, tabletop, visual};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

const SMALL: Intrinsics = Intrinsics { width: 160, height: 120, fx: 140.0, fy: 138.0, cx: 77.3, cy: 61.9 };

/// The wgpu renderer; `None`, visibly, where there is no adapter, which `GRIP_REQUIRE_ADAPTER=1` forbids.
fn wgpu_or_skip(test: &str) -> Option<Box<dyn Renderer>> {
    match WgpuRenderer::new() {
        Ok(renderer) => Some(Box::new(renderer)),
        Err(error) => {
            assert!(
                std::env::var_os("GRIP_REQUIRE_ADAPTER").is_none_or(|v| v != "1"),
                "GRIP_REQUIRE_ADAPTER=1, but {error}"
            );
            println!("SKIPPED {test} on wgpu: {error}");
            None
        }
    }
}

/// Every renderer that this machine has.
fn renderers(test: &str) -> Vec<Box<dyn Renderer>> {
    let mut all: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new())];
    all.extend(wgpu_or_skip(test));
    all
}

fn ambient(lux: f64) -> Lighting {
    Lighting { ambient_lux: lux, ..Lighting::default() }
}

fn one(mesh: Mesh, material: Material, pose: Isometry3<f64>, label: u16) -> RenderScene {
    RenderScene { instances: vec![Instance { visual: visual(mesh, material), pose, label }], bounce: None }
}

/// Draws with the camera at the world's origin, so that world is the optical frame.
fn draw(renderer: &mut dyn Renderer, scene: &RenderScene) -> Rendering {
    renderer.render(scene, &ambient(100.0), &SMALL, &Pose::identity()).unwrap()
}

/// Calls `check(u, v, x/z, y/z)` for every pixel.
fn for_pixels(mut check: impl FnMut(usize, usize, f64, f64)) {
    for v in 0..SMALL.height {
        for u in 0..SMALL.width {
            let ray = SMALL.back_project(u as f64, v as f64, 1.0);
            check(u, v, ray.x, ray.y);
        }
    }
}

#[test]
fn a_plane_straight_on_has_constant_depth() {
    let plane = cuboid([9.0, 9.0, 0.2], 1.0);
    let scene = one(plane, Material::default(), at([0.0, 0.0, 1.35], 0.0), 7);
    for mut renderer in renderers("plane") {
        let seen = draw(renderer.as_mut(), &scene);
        for_pixels(|u, v, x, y| {
            assert!((seen.depth.at(u, v) - 1.25).abs() < 1e-5, "{}", renderer.name());
            assert_eq!(*seen.labels.at(u, v), 7);
            let cos = 1.0 / (1.0 + x * x + y * y).sqrt();
            assert!((f64::from(*seen.cos_incidence.at(u, v)) - cos).abs() < 1e-5);
        });
    }
}

#[test]
fn a_tilted_plane_has_the_depth_of_its_equation() {
    let tilt = UnitQuaternion::from_euler_angles(0.9, 0.25, 0.0);
    let pose = Isometry3::from_parts(Translation3::new(0.05, 0.02, 1.1), tilt);
    let scene = one(cuboid([9.0, 9.0, 0.02], 1.0), Material::default(), pose, 1);
    let normal = tilt * Vector3::z();
    let near_face = Point3::new(0.05, 0.02, 1.1) - normal * 0.01 * normal.z.signum();
    for mut renderer in renderers("tilted plane") {
        let seen = draw(renderer.as_mut(), &scene);
        let mut worst = 0.0_f64;
        for_pixels(|u, v, x, y| {
            let ray = Vector3::new(x, y, 1.0);
            let z = normal.dot(&near_face.coords) / normal.dot(&ray);
            if z > 0.05 && z < 3.0 {
                worst = worst.max((f64::from(*seen.depth.at(u, v)) / z - 1.0).abs());
                let cos = normal.dot(&ray.normalize()).abs();
                assert!((f64::from(*seen.cos_incidence.at(u, v)) - cos).abs() < 1e-4);
            }
        });
        // Graphics adapters snap corners to 1/256 pixel.
        assert!(worst < 2e-4, "{}: {worst}", renderer.name());
    }
}

#[test]
fn a_sphere_has_the_depth_of_its_equation() {
    let (center, radius) = (Vector3::new(0.03, -0.02, 0.8), 0.2_f64);
    let scene =
        one(sphere(radius as f32, 200), Material::default(), at([center.x, center.y, center.z], 0.4), 3);
    for mut renderer in renderers("sphere") {
        let seen = draw(renderer.as_mut(), &scene);
        let (mut inside, mut outside) = (0, 0);
        for_pixels(|u, v, x, y| {
            let ray = Vector3::new(x, y, 1.0);
            let (a, b) = (ray.norm_squared(), ray.dot(&center));
            let discriminant = b * b - a * (center.norm_squared() - radius * radius);
            let depth = f64::from(*seen.depth.at(u, v));
            if discriminant > 2e-3 {
                let z = (b - discriminant.sqrt()) / a;
                assert!((depth - z).abs() < 2e-4, "{} {depth} {z}", renderer.name());
                assert_eq!(*seen.labels.at(u, v), 3);
                let normal = (ray * z - center) / radius;
                let cos = -normal.dot(&ray.normalize());
                assert!((f64::from(*seen.cos_incidence.at(u, v)) - cos).abs() < 5e-3);
                inside += 1;
            } else if discriminant < -1e-3 {
                assert_eq!((depth, *seen.labels.at(u, v)), (0.0, 0));
                outside += 1;
            }
        });
        assert!(inside > 2000 && outside > 2000, "{inside} {outside}");
    }
}

#[test]
fn a_texture_appears_upright_with_its_corners_in_place() {
    // Four differently coloured quarters: top left red, top right green, bottom left blue, bottom right white.
    let quarters = image::RgbImage::from_fn(64, 64, |x, y| {
        image::Rgb(match (x < 32, y < 32) {
            (true, true) => [255, 0, 0],
            (false, true) => [0, 255, 0],
            (true, false) => [0, 0, 255],
            (false, false) => [255, 255, 255],
        })
    });
    // A sheet that faces the camera: x right, y down as in the optical frame, (0, 0) of the texture at its top left.
    let corners = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
    let sheet = Mesh {
        positions: corners.iter().map(|c| Point3::new(c[0], c[1], 0.0)).collect(),
        normals: vec![-Vector3::z(); 4],
        uvs: corners.iter().map(|c| [c[0] + 0.5, c[1] + 0.5]).collect(),
        triangles: vec![[0, 1, 2], [1, 3, 2]],
        ..Mesh::default()
    };
    let material =
        Material { base_color: [1.0; 3], roughness: 1.0, metallic: 0.0, texture: Some(Arc::new(quarters)) };
    let scene = one(sheet, material, at([0.0, 0.0, 1.0], 0.0), 1);
    for mut renderer in renderers("texture") {
        let seen = draw(renderer.as_mut(), &scene);
        let color = |x: f64, y: f64| {
            let p = SMALL.project(&Point3::new(x, y, 1.0)).unwrap();
            let c = *seen.radiance.at(p.x as usize, p.y as usize);
            let brightest = c.iter().copied().fold(0.0, f32::max);
            c.map(|v| v > 0.5 * brightest)
        };
        assert_eq!(color(-0.25, -0.25), [true, false, false], "{}", renderer.name());
        assert_eq!(color(0.25, -0.25), [false, true, false]);
        assert_eq!(color(-0.25, 0.25), [false, false, true]);
        assert_eq!(color(0.25, 0.25), [true, true, true]);
    }
}

#[test]
fn luminance_follows_the_inverse_square_law_and_shadows_take_it_away() {
    // A lamp beside the camera lights a matt white wall; a small plate hides it from part of the wall.
    let lamp = |intensity_cd| Lighting {
        lights: vec![Light {
            position: Vector3::new(0.5, 0.0, 0.0),
            target: Vector3::new(0.0, 0.0, 2.0),
            intensity_cd,
            color: [1.0; 3],
            radius: 0.0,
            half_angle: std::f64::consts::PI,
            shadows: true,
        }],
        ..Lighting::default()
    };
    let material = Material { base_color: [1.0; 3], roughness: 1.0, ..Material::default() };
    let mut scene = one(cuboid([9.0, 9.0, 0.02], 1.0), material.clone(), at([0.0, 0.0, 2.01], 0.0), 1);
    scene.instances.push(Instance {
        visual: visual(cuboid([0.2, 0.2, 0.01], 1.0), material),
        pose: at([0.25, 0.0, 1.0], 0.0),
        label: 2,
    });
    for mut renderer in renderers("luminance") {
        let seen = renderer.render(&scene, &lamp(100.0), &SMALL, &Pose::identity()).unwrap();
        let pixel_of = |x: f64, y: f64| {
            let p = SMALL.project(&Point3::new(x, y, 2.0)).unwrap();
            (p.x.round() as usize, p.y.round() as usize)
        };
        for (x, y) in [(-0.8, 0.3), (-0.5, -0.5), (0.5, -0.7)] {
            let (u, v) = pixel_of(x, y);
            let wall = SMALL.back_project(u as f64, v as f64, 2.0);
            let d2 = (wall.coords - Vector3::new(0.5, 0.0, 0.0)).norm_squared();
            // Matt luminance E cos / (pi d^2); the surface's gloss takes 4 % of the light and returns some of it.
            let matt = 100.0 / d2 * (2.0 / d2.sqrt()) / std::f64::consts::PI;
            let ratio = f64::from(seen.radiance.at(u, v)[1]) / matt;
            assert!((0.955..1.05).contains(&ratio), "{} at {x} {y}: {ratio}", renderer.name());
        }
        // Seen from the lamp the plate covers x -0.2 .. 0.2 of the wall; the camera sees that beside the plate.
        let (u, v) = pixel_of(-0.1, 0.0);
        assert!(seen.radiance.at(u, v)[1] < 1e-3, "{}", renderer.name());
    }
}

#[test]
fn half_shadows_of_a_straight_edge_follow_the_segment_of_the_lights_disk() {
    // A round lamp shines straight at a wall, 2 m away; 0.5 m before the wall a sheet covers all that is right of x = 0.6.
    const RADIUS: f64 = 0.4;
    let lighting = Lighting {
        lights: vec![Light {
            position: Vector3::new(0.6, 0.0, 0.0),
            target: Vector3::new(0.6, 0.0, 2.0),
            intensity_cd: 100.0,
            color: [1.0; 3],
            radius: RADIUS,
            half_angle: 1.0,
            shadows: true,
        }],
        ..Lighting::default()
    };
    let material = Material { base_color: [1.0; 3], roughness: 1.0, ..Material::default() };
    let wall = one(cuboid([9.0, 9.0, 0.02], 1.0), material.clone(), at([0.0, 0.0, 2.01], 0.0), 1);
    let mut covered = wall.clone();
    covered.instances.push(Instance {
        visual: visual(cuboid([0.8, 2.0, 0.002], 1.0), material),
        pose: at([1.0, 0.0, 1.5], 0.0),
        label: 2,
    });
    for mut renderer in renderers("half-shadows") {
        let [free, shaded] = [&wall, &covered]
            .map(|scene| renderer.render(scene, &lighting, &SMALL, &Pose::identity()).unwrap().radiance);
        // How far a pixel may be from the closed form, in the mean; and from its column, where all are the same: the
        // picture's grain. The CPU asks few rays first, and no more where those agree: its half-shadows are steeper.
        let [most_off, most_grain] = if renderer.name() == "cpu" { [0.1, 0.15] } else { [0.03, 0.06] };
        let (mut off, mut grain, mut count) = (0.0, 0.0, 0.0);
        for u in 0..SMALL.width {
            let x = 2.0 * SMALL.back_project(u as f64, 0.0, 1.0).x;
            // Where a line from the wall by the edge meets the lamp's disk, in radii.
            let s = (x - 0.6) * (2.0 / 0.5 - 1.0) / RADIUS;
            if s.abs() > 0.95 {
                continue;
            }
            let lit = 0.5 - (s * (1.0 - s * s).sqrt() + s.asin()) / std::f64::consts::PI;
            let shares = (20..100).map(|v| f64::from(shaded.at(u, v)[1] / free.at(u, v)[1]));
            let mean = shares.clone().sum::<f64>() / 80.0;
            off += (mean - lit).abs();
            grain += (shares.map(|share| (share - mean).powi(2)).sum::<f64>() / 80.0).sqrt();
            count += 1.0;
        }
        let (off, grain) = (off / count, grain / count);
        println!("{}: {off:.4} off the closed form, grain {grain:.4}", renderer.name());
        assert!(count > 15.0 && off < most_off && grain < most_grain, "{}: {off} {grain}", renderer.name());
    }
}

#[test]
fn both_renderers_draw_the_same_scene() {
    let Some(mut wgpu) = wgpu_or_skip("agreement") else {
        return;
    };
    let scene = tabletop();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/conditions");
    for name in ["base", "light-left"] {
        let condition = ConditionSpec::load_named(&folder, name)
            .unwrap()
            .draw(&mut grip_sim::rng::stream(1, "condition"));
        let draw = |renderer: &mut dyn Renderer| {
            renderer.render(&scene, &condition.lighting, &Intrinsics::FETCH, &head_camera()).unwrap()
        };
        let a = draw(wgpu.as_mut());
        let b = draw(&mut CpuRenderer::new());
        let pixels = a.labels.data().len();
        let same: Vec<usize> = (0..pixels).filter(|&i| a.labels.data()[i] == b.labels.data()[i]).collect();
        let close = |i: &&usize| (a.depth.data()[**i] - b.depth.data()[**i]).abs() < 1e-3;
        let near = same.iter().filter(close).count();
        let cos = same
            .iter()
            .filter(|&&i| (a.cos_incidence.data()[i] - b.cos_incidence.data()[i]).abs() < 0.01)
            .count();
        let sum = |f: &dyn Fn(usize) -> f32| (0..3 * pixels).map(|i| f64::from(f(i))).sum::<f64>();
        let of = |r: &Rendering, i: usize| r.radiance.data()[i / 3][i % 3];
        let color = sum(&|i| (of(&a, i) - of(&b, i)).abs()) / sum(&|i| of(&b, i));
        let share = |n: usize, of: usize| n as f64 / of as f64;
        println!(
            "{name}: labels equal {:.5}, depth within 1 mm {:.5}, cos within 0.01 {:.5}, mean colour difference {color:.4}",
            share(same.len(), pixels),
            share(near, same.len()),
            share(cos, same.len()),
        );
        assert!(share(same.len(), pixels) > 0.995);
        assert!(share(near, same.len()) > 0.995);
        assert!(share(cos, same.len()) > 0.99);
        // Soft against hard shadow edges, mostly.
        assert!(color < 0.03, "{name}: {color}");
    }
}

#[test]
fn pictures_repeat_to_the_bit_on_any_number_of_threads() {
    let scene = tabletop();
    let small = Intrinsics { width: 160, height: 120, fx: 138.0, fy: 138.0, cx: 79.5, cy: 59.5 };
    let bits = |r: &Rendering| {
        let mut bits: Vec<u32> = r.depth.data().iter().map(|z| z.to_bits()).collect();
        bits.extend(r.radiance.data().iter().flatten().map(|c| c.to_bits()));
        bits.extend(r.cos_incidence.data().iter().map(|c| c.to_bits()));
        bits
    };
    let draw = |renderer: &mut dyn Renderer| {
        bits(&renderer.render(&scene, &ambient(80.0), &small, &head_camera()).unwrap())
    };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&mut CpuRenderer::new()))
    };
    assert_eq!(on(1), on(3));
    if let Some(mut wgpu) = wgpu_or_skip("repeatability") {
        let first = draw(wgpu.as_mut());
        assert_eq!(first, draw(wgpu.as_mut()));
    }
}

#[test]
fn empty_scenes_and_changing_sizes_are_fine() {
    for mut renderer in renderers("empty scene") {
        for (width, height) in [(160, 120), (33, 17), (640, 480)] {
            let intrinsics = Intrinsics { width, height, ..Intrinsics::FETCH };
            let seen = renderer
                .render(&RenderScene::default(), &ambient(50.0), &intrinsics, &Pose::identity())
                .unwrap();
            assert_eq!(seen.depth, Image::filled(width, height, 0.0));
            assert_eq!(seen.labels, Image::filled(width, height, 0));
            // The background is a dim wall.
            assert!(seen.radiance.data().iter().all(|c| c[0] > 1.0 && c[0] < 20.0));
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_refused_with_a_reason() {
    let cube = || cuboid([0.1; 3], 1.0);
    let mut broken = cube();
    broken.triangles.push([0, 1, 999]);
    let mut short = cube();
    short.normals.pop();
    let mut nowhere = cube();
    nowhere.positions[3].x = f32::NAN;
    let place = at([0.0, 0.0, 1.0], 0.0);
    let of = |mesh| one(mesh, Material::default(), place, 1);
    let far = one(cube(), Material::default(), at([f64::NAN, 0.0, 1.0], 0.0), 5);
    let dark = Lighting { ambient_lux: -1.0, ..Lighting::default() };
    let huge = Intrinsics { width: 100_000, ..SMALL };
    let bright = ambient(10.0);
    for mut renderer in renderers("refusals") {
        let mut error = |scene: &RenderScene, lighting: &Lighting, intrinsics: &Intrinsics| {
            let camera: Pose<World, Camera> = Pose::identity();
            renderer.render(scene, lighting, intrinsics, &camera).unwrap_err().to_string()
        };
        assert!(error(&of(broken.clone()), &bright, &SMALL).contains("999"));
        assert!(error(&of(short.clone()), &bright, &SMALL).contains("normals"));
        assert!(error(&of(nowhere.clone()), &bright, &SMALL).contains("vertex 3"));
        assert!(error(&far, &bright, &SMALL).contains("label 5"));
        assert!(error(&of(cube()), &dark, &SMALL).contains("ambient_lux = -1"));
        assert!(error(&of(cube()), &bright, &huge).contains("100000"));
        // And it still works afterwards.
        renderer.render(&of(cube()), &bright, &SMALL, &Pose::identity()).unwrap();
    }
}

#[test]
fn auto_always_finds_a_renderer_and_frames_repeat() {
    let condition = ConditionSpec::load_named(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/conditions"),
        "dark",
    )
    .unwrap()
    .draw(&mut grip_sim::rng::stream(1, "condition"));
    let mut renderer = open(RendererChoice::Auto).unwrap();
    let scene = one(cuboid([0.3; 3], 1.0), Material::default(), at([0.0, 0.0, 1.0], 0.3), 4);
    let mut take = |seed| {
        capture(
            renderer.as_mut(),
            &scene,
            &condition,
            &SMALL,
            &Pose::identity(),
            &Sensors::default(),
            &mut grip_sim::rng::stream(seed, "camera"),
        )
        .unwrap()
    };
    let (first, truth) = take(1);
    let (again, _) = take(1);
    let (other, _) = take(2);
    assert_eq!((&first.rgb, &first.depth), (&again.rgb, &again.depth));
    assert_ne!(first.depth, other.depth);
    // Depth does not mind the dark: it is off by millimetres.
    let (u, v) = (80, 60);
    let (read, true_depth) = (*first.depth.at(u, v), *truth.depth.at(u, v));
    assert!(read > 0.0 && (read - true_depth).abs() < 0.01, "{read} {true_depth}");
}

/// Resident memory of this process, bytes; `None` where the system does not tell.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    Some(1024 * line.split_whitespace().nth(1)?.parse::<u64>().ok()?)
}

#[test]
fn two_thousand_frames_of_ever_new_meshes_leave_memory_flat() {
    let Some(mut renderer) = wgpu_or_skip("memory") else { return };
    let camera = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };
    let light = Light {
        position: Vector3::new(0.3, -0.5, 0.0),
        target: Vector3::new(0.0, 0.0, 1.0),
        intensity_cd: 100.0,
        color: [1.0; 3],
        radius: 0.05,
        half_angle: 0.8,
        shadows: true,
    };
    let lighting = Lighting { lights: vec![light], ..ambient(10.0) };
    let mut early = 0;
    for i in 0..2000 {
        // A new mesh and a new texture each time: 60 kB that must be given back.
        let texture = image::RgbImage::from_pixel(64, 64, image::Rgb([i as u8; 3]));
        let material = Material { texture: Some(Arc::new(texture)), ..Material::default() };
        let scene = one(sphere(0.2, 24), material, at([0.0, 0.0, 1.0], 0.01 * f64::from(i)), 1);
        let seen = renderer.render(&scene, &lighting, &camera, &Pose::identity()).unwrap();
        assert_eq!(*seen.labels.at(32, 24), 1);
        if i == 400 {
            early = resident().unwrap_or(0);
        }
    }
    let late = resident().unwrap_or(0);
    println!("resident after 400 frames {} MB, after 2000 {} MB", early >> 20, late >> 20);
    assert!(late as f64 <= 1.05 * early as f64, "{early} {late}");
}
