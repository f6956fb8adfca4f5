use super::look::truth;
use super::*;
use crate::progress::Quiet;
use crate::setup::SetupOptions;
use grip_manip::GripperCommand;
use grip_manip::executor::{ControlTarget, RobotPort};
use grip_sim::render::{RendererChoice, open};

#[test]
fn an_object_that_is_not_believed_is_an_obstacle_where_it_stands() {
    let setup = Setup::load(&SetupOptions { seed: 4, ..SetupOptions::default() }).unwrap();
    let (world, _) = setup.drop_objects().unwrap();
    let mut renderer = open(RendererChoice::Cpu).unwrap();
    let (frame, _) = setup.capture(&world, renderer.as_mut(), 0).unwrap();
    let planner = setup.planner();
    let seen_without = |left_out: Option<usize>| {
        let asked: Vec<usize> = (0..setup.models.len()).filter(|i| Some(*i) != left_out).collect();
        let records = vec![ItemRecord::default(); setup.models.len()];
        let belief = Belief::new(&setup, &frame, &truth(&world, &frame.world_from_camera, &asked), &records);
        planner.unmodelled_obstacles(&belief.scene, &frame, world.joints())
    };
    assert_eq!(seen_without(None), [], "everything is known");
    for i in 0..setup.models.len() {
        let seen = seen_without(Some(i));
        let name = &setup.models[i].info.name;
        assert!(seen.len() > 8, "{name}: {}", seen.len());
        let centre = world.truth(i).translation();
        let reach = setup.models[i].diameter / 2.0 + 0.02;
        assert!(seen.iter().all(|p| (p.coords - centre).norm() < reach), "{name}");
    }
}

#[test]
fn what_the_last_attempt_knocks_out_is_counted_once() {
    let setup = Setup::load(&SetupOptions { seed: 4, ..SetupOptions::default() }).unwrap();
    let (planner, mut renderer) = (setup.planner(), open(RendererChoice::Cpu).unwrap());
    let options = TrialOptions::default();
    let mut trial =
        Trial::begin(&setup, &Estimator::Truth, &planner, renderer.as_mut(), options, &Quiet).unwrap();
    let (handled, lost) = (0, 1);
    let attempt = Attempt { object: handled, locations: trial.locations(), poses: trial.world.poses() };
    // The same world with one object on the floor.
    let mut poses = attempt.poses.clone();
    poses[lost] = Pose::from_xyz_rpy([0.0, 1.5, 0.2], [0.0; 3]);
    let mut world = setup.empty_world(setup.cell.start.clone()).unwrap();
    for (model, pose) in setup.models.iter().zip(&poses) {
        world.add_object(model.clone(), pose).unwrap();
    }
    trial.world = world;
    trial.settle(&attempt);
    assert_eq!(trial.records[handled].measures.knocked_out, 1);
    let result = trial.finish().unwrap().result;
    assert_eq!(result.items[handled].measures.knocked_out, 1);
    assert_eq!(result.items[lost].measures.knocked_out, 0);
    assert_eq!(result.items[lost].outcome, Outcome::KnockedOut);
}

#[test]
fn in_doubt_the_robot_looks_from_elsewhere_and_forgets_nothing() {
    let mut settings = crate::settings::Settings::default();
    settings.trial.second_look_mass = 0.1;
    let options =
        SetupOptions { seed: 9601, settings: std::sync::Arc::new(settings), ..SetupOptions::default() };
    let setup = Setup::load(&options).unwrap();
    let detector = crate::estimators::DetectorKind::Clusters;
    let estimator = crate::estimators::Grip::open(
        &setup,
        crate::estimators::SecondStage::Grip,
        detector,
        &Default::default(),
    )
    .unwrap();
    let estimator = Estimator::Perception(Box::new(estimator));
    let (planner, mut renderer) = (setup.planner(), open(RendererChoice::Cpu).unwrap());
    let options = TrialOptions::default();
    let mut trial = Trial::begin(&setup, &estimator, &planner, renderer.as_mut(), options, &Quiet).unwrap();
    // A meat can's two ends are alike: it is looked at again.
    let seen = trial.look().unwrap();
    let [first, second] = trial.cameras[..] else { panic!("{} looks", trial.cameras.len()) };
    let lowered = first.translation().z - second.translation().z;
    let wanted = setup.cell.scene.robot.torso.unwrap() - setup.settings.trial.second_look_torso_m;
    // Tilting the head moves the camera, too.
    assert!((lowered - wanted).abs() < 0.03, "{lowered} {wanted}");
    let can = setup.models.iter().position(|model| model.info.name == "010_potted_meat_can").unwrap();
    let at = second.inverse() * trial.world.truth(can);
    assert!(at.translation().xy().norm() < 0.02 * at.translation().z, "the head looks at it: {at:?}");
    // Both views count, and what the second does not show is where the first has it.
    assert_eq!(seen.estimates.len(), 5);
    let followed = |of: usize| seen.estimates.iter().find(|(i, _)| *i == of).unwrap().1.followed;
    assert_eq!(followed(can), 1);
    for (i, posterior) in &seen.estimates {
        let believed = seen.frame.world_from_camera * posterior.best;
        let off = believed.translation() - trial.world.truth(*i).translation();
        assert!(off.norm() < 0.005, "{}: {off}", setup.name(*i));
    }
    // Home is back up.
    let belief = trial.believe(&seen);
    trial.go_home(belief);
    let home = setup.cell.world_from_camera(trial.world.joints());
    assert!((home.translation() - first.translation()).norm() < 0.01);
}

/// A heap of which nothing can be gripped at first.
#[test]
fn what_is_too_crowded_is_pushed_apart_and_packed() {
    let options = SetupOptions { seed: 6023, condition: "clutter-2".into(), ..SetupOptions::default() };
    let packed = |max_pushes| {
        let mut settings = crate::settings::Settings::default();
        settings.trial.max_pushes = max_pushes;
        let setup = Setup::load(&SetupOptions { settings: std::sync::Arc::new(settings), ..options.clone() })
            .unwrap();
        let (planner, mut renderer) = (setup.planner(), open(RendererChoice::Cpu).unwrap());
        let result = super::run(
            &setup,
            &Estimator::Truth,
            &planner,
            renderer.as_mut(),
            TrialOptions::default(),
            &Quiet,
        )
        .unwrap()
        .result;
        (result.score.pushes, result.packed)
    };
    let (pushes, with) = packed(3);
    let (none, without) = packed(0);
    assert!(pushes >= 1 && none == 0 && with >= without + 3, "{pushes} pushes: {with}, without {without}");
}

/// True poses are not read off a picture: its light may go, but not what depth is made of.
#[test]
fn a_picture_for_depth_alone_has_the_same_depth() {
    for noise in ["carmine-109", "fetch-head", "d435"] {
        let mut setup = Setup::load(&SetupOptions::default()).unwrap();
        setup.camera.sensors = setup.settings.sensor.sensors(noise).unwrap();
        let (world, _) = setup.drop_objects().unwrap();
        let mut renderer = open(RendererChoice::Cpu).unwrap();
        let lit = setup.capture(&world, renderer.as_mut(), 0).unwrap().0;
        let dark = setup.capture_depth(&world, renderer.as_mut(), 0).unwrap();
        assert_eq!(lit.depth, dark.depth, "{noise}");
    }
}

/// The setup of the base condition with these errors of calibration in its file.
fn miscalibrated(errors: &str) -> Setup {
    let folder = tempfile::tempdir().unwrap();
    let base = include_str!("../../scenes/conditions/base.toml");
    let file = folder.path().join("off.toml");
    std::fs::write(&file, format!("{base}\n[calibration_error]\n{errors}\n")).unwrap();
    let condition = file.to_str().unwrap().to_owned();
    Setup::load(&SetupOptions { condition, seed: 4, ..SetupOptions::default() }).unwrap()
}

#[test]
fn a_camera_that_is_not_where_it_is_believed_moves_all_that_is_seen() {
    let base = Setup::load(&SetupOptions { seed: 4, ..SetupOptions::default() }).unwrap();
    let off = miscalibrated("camera = { shift = 0.01 }\ndepth_scale = 1.02");
    let (world, _) = base.drop_objects().unwrap();
    let mut renderer = open(RendererChoice::Cpu).unwrap();
    let (frame, _) = off.capture(&world, renderer.as_mut(), 0).unwrap();
    let (true_frame, _) = base.capture(&world, renderer.as_mut(), 0).unwrap();
    assert_eq!(frame.world_from_camera, true_frame.world_from_camera, "the robot does not know");
    assert_ne!(frame.rgb, true_frame.rgb);
    // The best that can be seen is 10 mm off, however well the picture is understood.
    let asked: Vec<usize> = (0..off.models.len()).collect();
    for (i, seen) in truth(&world, &off.true_camera(&world), &asked) {
        let believed = frame.world_from_camera * seen.best;
        let error = (believed.translation() - world.truth(i).translation()).norm();
        assert!((error - 0.01).abs() < 1e-9, "{error}");
    }
    let record = off.miscalibration.record().unwrap();
    assert!((record.camera_shift_m - 0.01).abs() < 1e-12 && record.camera_turn_rad < 1e-6);
    assert_eq!(base.miscalibration.record(), None);
    // Where the camera is right, depth alone is off.
    let scaled = miscalibrated("depth_scale = 1.02");
    let (frame, _) = scaled.capture(&world, renderer.as_mut(), 0).unwrap();
    let pairs = frame.depth.data().iter().zip(true_frame.depth.data());
    assert!(pairs.into_iter().all(|(z, true_z)| *z == true_z * 1.02_f32));
}

#[test]
fn joints_go_where_their_encoders_say_and_measurements_are_late() {
    let setup = miscalibrated("joints = { min = -0.02, max = 0.02 }\nlatency = 0.05");
    let start = &setup.cell.start;
    let mut world = setup.drop_objects().unwrap().0;
    let arm = &setup.cell.config.arm;
    let furthest = |a: &[f64], b: &[f64]| arm.iter().map(|&j| (a[j] - b[j]).abs()).fold(0.0, f64::max);
    assert!(furthest(&setup.measured_joints(&world), start) < 1e-12, "it believes to be at the start");
    assert!(furthest(world.joints(), start) > 0.002, "and is not");
    assert_ne!(setup.true_camera(&world), setup.cell.world_from_camera(start));
    // A joint on its way at 0.1 rad/s: what is measured is 12 periods old.
    let joint = arm[0];
    let shared = SharedWorld::new(&mut world);
    let mut port = WorldPort::new(&shared, &setup.miscalibration);
    let mut past = Vec::new();
    for k in 0..60 {
        let mut target = start.clone();
        target[joint] += 0.1 * f64::from(k) / 240.0;
        past.push(setup.measured_joints(&shared.borrow())[joint]);
        assert_eq!(port.joints()[joint], past[past.len().saturating_sub(13)]);
        port.step(&ControlTarget { joints: &target, gripper: GripperCommand::Hold }).unwrap();
    }
    assert!((past[59] - past[0] - 0.1 * 58.0 / 240.0).abs() < 0.005, "{} {}", past[0], past[59]);
}
