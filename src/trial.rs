//! One trial, top to bottom: look, estimate, believe, plan, act, score; again until nothing is left to pack.
//!
//! Scene -> World -> CameraFrame -> Detections -> PosePosterior -> Grasp -> Trajectory -> Outcome -> Score -> Report

use std::time::Instant;

use anyhow::Result;
use grip_manip::executor::{ExecutionReport, ExecutorSettings, execute, execute_motion};
use grip_manip::{BeliefScene, BelievedObject, Care, PickPlacePlan, PlanStage, Planner, pick_order};
use grip_perception::PosePosterior;
use grip_sim::frame::CameraFrame;
use grip_sim::images::RgbImage;
use grip_sim::physics::{Grip, STEP_HZ, World};
use grip_sim::pose::{Object, Pose, World as WorldFrame};
use grip_sim::render::Renderer;
use indicatif::ProgressBar;
use nalgebra::Point3;

use crate::film::{Film, Strip};
use crate::ledger::{Ledger, failure_of, finish};
use crate::motion_check::JointLog;
use crate::outcome::{ItemTiming, Measures, Outcome, Stage, TRIAL_SCHEMA, Timing, TrialResult};
use crate::perceive::Perception;
use crate::pictures;
use crate::port::{SharedWorld, Watcher, WorldPort};
use crate::report::LookPictures;
use crate::scenario::{Options, Scenario};
use crate::score::{self, Watch, Whereabouts};
use crate::scorecard::{self, DISTURBED_M};
use crate::setup::Setup;

/// Looks in a row after which nothing could be planned end the trial.
const MAX_FRUITLESS_LOOKS: u32 = 2;
/// Below this confidence an estimate is no target, only an obstacle.
const CONFIDENT: f64 = 0.25;
/// Poses of the posterior that a grasp is tried at.
const POSES: usize = 32;
/// An item in the bin is not believed to have moved farther than this from where it was put, metres.
const MOVED_IN_BIN_M: f64 = 0.12;
/// Simulated seconds after an attempt for what still rolls to come to rest.
const CALM_S: f64 = 2.0;
/// Simulated seconds at the end of the trial for everything to come to rest.
const FINAL_SETTLE_S: f64 = 8.0;
/// Simulated seconds after that in which nothing should move any more.
const DRIFT_S: f64 = 1.0;

/// What to run.
#[derive(Debug, Clone)]
pub struct Spec {
    /// The estimator's name.
    pub estimator: String,
    /// How many of the scene's objects are to be packed; the rest is clutter.
    pub items: usize,
    /// Which pictures to make for people; nothing else depends on them.
    pub pictures: Pictures,
}

/// Pictures of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pictures {
    /// Every look, every attempt from outside, and the scene at the end.
    All {
        /// And an animated replay.
        record: bool,
    },
    /// Attempts from outside.
    Film,
    /// The same if not everything was packed.
    FilmOfFailures,
}

/// A finished trial.
pub struct Trial {
    /// The score.
    pub result: TrialResult,
    /// The pictures of every look.
    pub looks: Vec<LookPictures>,
    /// What it depended on.
    pub scenario: Scenario,
    /// The scene after the last action.
    pub after: Option<RgbImage>,
    /// Each attempt from outside.
    pub strips: Vec<Strip>,
    /// The animated replay, a GIF.
    pub replay: Option<Vec<u8>>,
}

/// Runs a trial.
///
/// # Errors
/// When rendering, estimation or the world fails; a failed grasp is a result, not an error.
pub fn run(
    setup: &Setup,
    spec: &Spec,
    options: &Options,
    planner: &Planner,
    perception: &Perception,
    renderer: &mut dyn Renderer,
    progress: &ProgressBar,
) -> Result<Trial> {
    let started = Instant::now();
    progress.set_message("settling the scene");
    let (mut world, dropped) = setup.drop_objects()?;
    log::info!("scene settled in {:.1} s, {} layouts rejected", dropped.settle_s, dropped.rejected.len());

    let mut ledgers = vec![Ledger::default(); setup.models.len()];
    let mut looks = Vec::new();
    let mut cameras = Vec::new();
    let mut look = 0;
    let mut fruitless = 0;
    let mut handled = None;
    let mut log = JointLog::default();
    let all = matches!(spec.pictures, Pictures::All { .. });
    let mut film = Film::new(setup, spec.pictures == Pictures::All { record: true });
    let scenario = Scenario::new(setup, perception, spec.items, options)?;

    loop {
        let open: Vec<usize> = (0..spec.items).filter(|&i| ledgers[i].is_open()).collect();
        if open.is_empty() || fruitless >= MAX_FRUITLESS_LOOKS {
            break;
        }
        let packed = ledgers.iter().filter(|l| l.believed_packed.is_some()).count();
        progress.set_message(format!(
            "look {}: estimating poses ({packed} of {} packed)",
            look + 1,
            spec.items
        ));

        // Look and estimate everything that is not believed to be in the bin.
        let (frame, _) = setup.capture(&world, renderer, look)?;
        cameras.push(frame.world_from_camera);
        let asked: Vec<usize> =
            (0..ledgers.len()).filter(|&i| ledgers[i].believed_packed.is_none()).collect();
        let (out, posteriors) = perception.look(setup, &world, &frame, &cameras, &asked)?;
        let mut errors = vec![None; ledgers.len()];
        for (&i, posterior) in out.iter().zip(&posteriors) {
            ledgers[i].estimate_s += posterior.seconds;
            let truth = frame.world_from_camera.inverse() * world.truth(i);
            let (add, adds) = score::pose_errors(world.object(i), &truth, &posterior.best);
            errors[i] = Some((add, adds));
            // After an attempt the errors of the look before it stay.
            if ledgers[i].attempts == 0 {
                ledgers[i].record_errors(errors[i]);
            }
        }
        relook_at_bin(setup, perception, &world, &frame, &mut ledgers, look)?;

        // Believe, and plan for the first open object that can be packed.
        let (mut belief, belief_index) = believe(setup, &frame, &out, &posteriors, &ledgers);
        belief.seen = planner.unexplained(&belief, &frame, world.joints());
        log::debug!("look {look}: {} points of what is not recognised", belief.seen.len());
        let mut order = pick_order(&belief);
        order.iter_mut().for_each(|tier| tier.retain(|&b| open.contains(&belief_index[b])));
        for &i in open.iter().filter(|&&i| !order.iter().flatten().any(|&b| belief_index[b] == i)) {
            let confidence = out.iter().position(|&o| o == i).map_or(0.0, |p| posteriors[p].confidence);
            if belief_index.contains(&i) {
                ledgers[i].pass_over(
                    Outcome::NotGrasped,
                    Stage::Look,
                    "fell into the bin while another item was handled",
                );
            } else {
                let reason = format!("confidence {confidence:.2}");
                ledgers[i].pass_over(Outcome::NotPerceived, Stage::Look, reason);
            }
        }
        // In each tier first what can be picked without a risk.
        let mut chosen = None;
        let ways = |tier: &Vec<usize>| {
            let ways = [Care::Careful, Care::Bold].map(|care| tier.iter().map(move |&b| (care, b)));
            ways.into_iter().flatten().collect::<Vec<_>>()
        };
        for (care, b) in order.iter().flat_map(ways) {
            let i = belief_index[b];
            progress.set_message(format!("look {}: planning for {}", look + 1, setup.models[i].info.name));
            let clock = Instant::now();
            let plan = planner.plan_pick_place(
                &belief,
                b,
                world.joints(),
                care,
                setup.stream(&format!("plan/{look}/{i}")),
            );
            ledgers[i].plan_s += clock.elapsed().as_secs_f64();
            match plan {
                Ok(plan) => {
                    chosen = Some((i, plan));
                    break;
                }
                Err(failure) => {
                    log::debug!("{failure}: {:?}", failure.counters);
                    let outcome = match failure.stage {
                        PlanStage::NoPlacePose | PlanStage::NoPlaceIk => Outcome::NoPlace,
                        PlanStage::NoGrasp | PlanStage::NoIk | PlanStage::NoApproach | PlanStage::NoLift => {
                            Outcome::NoGrasp
                        }
                        _ => Outcome::NoPath,
                    };
                    ledgers[i].pass_over(outcome, Stage::Plan, failure.to_string());
                }
            }
        }
        let caption = match &chosen {
            Some((i, _)) => format!("picks {}", setup.models[*i].info.name),
            None => "nothing can be picked".to_string(),
        };
        if all {
            looks.push(draw_look(setup, renderer, &frame, &out, &posteriors, (caption, asked))?);
        }
        let Some((i, plan)) = chosen else {
            fruitless += 1;
            look += 1;
            continue;
        };
        fruitless = 0;

        // Act, with the score watching.
        progress.set_message(format!("look {}: packing {}", look + 1, setup.models[i].info.name));
        let whereabouts = score::whereabouts(&world, &setup.scene);
        let poses = world.poses();
        world.reset_peaks();
        let (report, watch) = act(setup, &mut world, i, &plan, (&mut log, &mut film));
        let ledger = &mut ledgers[i];
        ledger.attempts += 1;
        ledger.record_errors(errors[i]);
        if let Some(watch) = watch {
            ledger.clauses = watch.clauses;
            ledger.measures = Measures { knocked_out: ledger.measures.knocked_out, ..watch.measures };
            ledger.wrong_object = watch.wrong_object.is_some();
            ledger.wrong_objects += u32::from(ledger.wrong_object);
            ledger.slip_m = watch.slip_m;
        }
        ledger.close_attempt();
        ledger.peak_force_n = ledger.peak_force_n.max(world.peak_force(i));
        ledger.failure = None;
        match failure_of(&report) {
            Some((outcome, stage, reason)) => ledger.fail_attempt(outcome, stage, reason),
            None => ledger.believed_packed = Some(plan.world_from_object_placed()),
        }

        // Back to where the camera sees the table, then count what was knocked out. What still rolls comes to rest first.
        if ledgers[i].failure.is_some() {
            let_go(&mut world);
        }
        let known = Held { object: i, released: ledgers[i].believed_packed };
        go_home(setup, (&mut world, &mut log, &mut film), planner, belief, &belief_index, known, look);
        world.settle(CALM_S);
        note_losses(setup, &world, &mut ledgers, &whereabouts, i);
        note_disturbance(&world, &mut ledgers, (&whereabouts, &poses), i);
        handled = Some((i, whereabouts));
        look += 1;
    }

    progress.set_message("settling the bin");
    world.settle(FINAL_SETTLE_S);
    if let Some((i, whereabouts)) = handled {
        note_losses(setup, &world, &mut ledgers, &whereabouts, i);
    }
    note_blows(&world, &mut ledgers);
    let drift_m = world.drift(DRIFT_S);
    let items = finish(setup, &world, &mut ledgers, spec.items);
    let packed = items.iter().filter(|item| item.outcome == Outcome::Packed).count();
    let after = if all { Some(setup.capture(&world, renderer, look)?.0.rgb) } else { None };
    let strips = if spec.pictures == Pictures::FilmOfFailures && packed == spec.items {
        Vec::new()
    } else {
        film.strips(renderer, progress)?
    };
    let replay = film.replay(renderer, progress)?;
    let timing = |ledger: &Ledger| ItemTiming { estimate_s: ledger.estimate_s, plan_s: ledger.plan_s };
    let result = TrialResult {
        schema: TRIAL_SCHEMA.into(),
        scenario: scenario.hash(),
        seed: setup.seed,
        scene: setup.scene.name.clone(),
        condition: setup.condition.name.clone(),
        estimator: spec.estimator.clone(),
        detector: perception.detector().into(),
        object_set: setup.library.set().label().into(),
        renderer: renderer.name().into(),
        hypotheses: setup.hypotheses.name().into(),
        requested: spec.items,
        score: scorecard::fill(setup, &world, &ledgers, &items, drift_m),
        packed,
        motion_check: log.check(planner, &setup.empty_belief()),
        sim_s: world.time(),
        items,
        state_hash: world.state_hash(),
        timing: Some(Timing {
            wall_s: started.elapsed().as_secs_f64(),
            items: ledgers.iter().take(spec.items).map(timing).collect(),
        }),
    };
    Ok(Trial { result, scenario, looks, after, strips, replay })
}

/// Marks what left the table or the bin since `before`, and the item `handled` meanwhile.
fn note_losses(setup: &Setup, world: &World, ledgers: &mut [Ledger], before: &[Whereabouts], handled: usize) {
    let after = score::whereabouts(world, &setup.scene);
    for other in score::knocked_out(before, &after, handled) {
        ledgers[other].knocked_out = true;
        ledgers[handled].knocked_others = true;
        ledgers[handled].measures.knocked_out += 1;
    }
}

/// What an attempt at `handled` did to the other items.
fn note_disturbance(
    world: &World,
    ledgers: &mut [Ledger],
    (whereabouts, poses): (&[Whereabouts], &[Pose<WorldFrame, Object>]),
    handled: usize,
) {
    note_blows(world, ledgers);
    let ledger = &mut ledgers[handled];
    for (other, moved) in world.moved_since(poses).into_iter().enumerate().filter(|(i, _)| *i != handled) {
        ledger.others_moved_m = ledger.others_moved_m.max(moved);
        if moved > DISTURBED_M {
            ledger.disturbed[usize::from(whereabouts[other] == Whereabouts::Bin)] += 1;
        }
    }
}

/// The largest blow that each item has taken.
fn note_blows(world: &World, ledgers: &mut [Ledger]) {
    for (i, ledger) in ledgers.iter_mut().enumerate() {
        ledger.peak_impulse_n_s = ledger.peak_impulse_n_s.max(world.peak_impulse(i));
    }
}

/// Opens the gripper where it stands, so that nothing is carried about after a failure.
fn let_go(world: &mut World) {
    const OPENING_S: f64 = 0.8;
    // No wider than it takes: there may be a wall beside the hand.
    const OPENING_M: f64 = 0.03;
    world.clear_stop();
    let (target, _) = world.hold();
    let width = world.finger_positions().iter().sum::<f64>() + OPENING_M;
    for _ in 0..(OPENING_S * f64::from(STEP_HZ)) as u32 {
        world.step(&target, Grip::Open { width });
    }
}

/// Carries out a plan for object `i` with the score watching.
fn act(
    setup: &Setup,
    world: &mut World,
    i: usize,
    plan: &PickPlacePlan,
    (log, film): (&mut JointLog, &mut Film<'_>),
) -> (ExecutionReport, Option<Watch>) {
    let watch = Some(Watch::begin(world, i, setup.config.gripper.link));
    film.begin(world, &plan.object);
    let shared = SharedWorld::new(world);
    let mut watcher = Watcher { world: &shared, watch, log, film };
    let report = execute(&mut WorldPort::new(&shared), plan, &ExecutorSettings::default(), &mut watcher);
    log::debug!("{}: {:?}", plan.object, plan.grasp);
    for step in &report.steps {
        log::debug!(
            "{:?}: {:.2} s to {:.2} s, {:.0} N",
            step.name,
            step.begin_s,
            step.end_s,
            step.peak_contact_n
        );
    }
    (report, watcher.watch)
}

/// Where the object that was handled is believed to be now.
struct Held {
    object: usize,
    released: Option<Pose<WorldFrame, Object>>,
}

/// Moves the arm back to where the camera sees the table. When no path is found, or the way is blocked, the robot stays
/// and the next look has to do with what it sees.
fn go_home(
    setup: &Setup,
    (world, log, film): (&mut World, &mut JointLog, &mut Film<'_>),
    planner: &Planner,
    mut belief: BeliefScene,
    index: &[usize],
    held: Held,
    look: usize,
) {
    // The handled object is where it was put, or nobody knows where.
    if let Some(at) = index.iter().position(|&i| i == held.object) {
        match held.released {
            Some(pose) => {
                belief.objects[at].world_from_object = pose;
                belief.objects[at].packed = true;
            }
            None => {
                belief.objects.remove(at);
            }
        }
    }
    let seed = setup.stream(&format!("home/{look}"));
    match planner.plan_home(&belief, world.joints(), &setup.start, seed) {
        Ok(trajectory) => {
            let shared = SharedWorld::new(world);
            let mut port = WorldPort::new(&shared);
            let mut watcher = Watcher { world: &shared, watch: None, log, film };
            let report = execute_motion(&mut port, &trajectory, &ExecutorSettings::default(), &mut watcher);
            if let Some((.., reason)) = report.failure() {
                log::info!("on the way home: {reason}");
            }
        }
        Err(failure) => log::info!("no way home: {failure}"),
    }
}

/// Looks again at what is believed to lie in the bin: things tip over when they are let go, and the next place is planned
/// around them. A pose that is not confident, not in the bin, or far from where the item was put is not taken.
fn relook_at_bin(
    setup: &Setup,
    perception: &Perception,
    world: &World,
    frame: &CameraFrame,
    ledgers: &mut [Ledger],
    look: usize,
) -> Result<()> {
    let inside: Vec<usize> = (0..ledgers.len()).filter(|&i| ledgers[i].believed_packed.is_some()).collect();
    if inside.is_empty() {
        return Ok(());
    }
    let (inside, posteriors) = perception.look_into_bin(setup, world, frame, &inside, look)?;
    for (&i, posterior) in inside.iter().zip(&posteriors) {
        ledgers[i].estimate_s += posterior.seconds;
        let pose = frame.world_from_camera * posterior.best;
        let centre = Point3::from(pose.translation());
        let moved = ledgers[i]
            .believed_packed
            .map_or(f64::INFINITY, |put| (put.translation() - centre.coords).norm());
        if posterior.confidence >= CONFIDENT
            && moved < MOVED_IN_BIN_M
            && setup.scene.bin.contains(&centre, 0.1)
        {
            ledgers[i].believed_packed = Some(pose);
        }
    }
    Ok(())
}

/// The belief after a look: what was estimated with some confidence, and what was put into the bin where it was put.
///
/// Also tells for each believed object which of the scene's objects it is.
fn believe(
    setup: &Setup,
    frame: &CameraFrame,
    which: &[usize],
    posteriors: &[PosePosterior],
    ledgers: &[Ledger],
) -> (BeliefScene, Vec<usize>) {
    let mut belief = setup.empty_belief();
    let mut index = Vec::new();
    let mut add = |i: usize, pose, poses, position_std_m, confidence, packed| {
        let model = setup.models[i].clone();
        belief.objects.push(BelievedObject {
            name: model.info.name.clone(),
            model,
            world_from_object: pose,
            poses,
            position_std_m,
            confidence,
            packed,
        });
        index.push(i);
    };
    for (&i, posterior) in which.iter().zip(posteriors) {
        if posterior.confidence >= CONFIDENT {
            let pose = frame.world_from_camera * posterior.best;
            // What fell into the bin on the way is not fetched out of it again.
            let packed = setup.scene.bin.contains(&Point3::from(pose.translation()), 0.1);
            let poses = posterior
                .thinned(POSES)
                .into_iter()
                .map(|(pose, weight)| (frame.world_from_camera * pose, weight))
                .collect();
            add(i, pose, poses, posterior.position_std_m, posterior.confidence, packed);
        }
    }
    for (i, ledger) in ledgers.iter().enumerate() {
        if let Some(pose) = ledger.believed_packed {
            add(i, pose, Vec::new(), 0.0, 1.0, true);
        }
    }
    (belief, index)
}

/// The believed poses as outlines on the frame.
fn draw_look(
    setup: &Setup,
    renderer: &mut dyn Renderer,
    frame: &CameraFrame,
    which: &[usize],
    posteriors: &[PosePosterior],
    (caption, asked): (String, Vec<usize>),
) -> Result<LookPictures> {
    let believed = setup.render_believed(
        renderer,
        frame,
        which
            .iter()
            .zip(posteriors)
            .filter(|(_, p)| p.confidence >= CONFIDENT)
            .map(|(&i, p)| (i, frame.world_from_camera * p.best)),
    )?;
    Ok(LookPictures {
        caption,
        rgb: frame.rgb.clone(),
        depth: frame.depth.clone(),
        overlay: pictures::outlines(&frame.rgb, &believed),
        asked,
        world_from_camera: frame.world_from_camera,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;
    use grip_sim::render::{RendererChoice, open};

    #[test]
    fn an_object_that_is_not_believed_is_an_obstacle_where_it_stands() {
        let Command::Pack(args) = Cli::parse_from(["grip", "pack", "--seed", "4"]).command else {
            unreachable!()
        };
        let setup = Setup::load(&args.scene, &args.condition).unwrap();
        let (world, _) = setup.drop_objects().unwrap();
        let mut renderer = open(RendererChoice::Cpu).unwrap();
        let (frame, _) = setup.capture(&world, renderer.as_mut(), 0).unwrap();
        let planner = setup.planner(grip_manip::GraspAt::Best);
        let seen_without = |left_out: Option<usize>| {
            let out: Vec<usize> = (0..setup.models.len()).filter(|i| Some(*i) != left_out).collect();
            let posteriors = crate::perceive::truth(&world, &frame, &out);
            let ledgers = vec![Ledger::default(); setup.models.len()];
            let (belief, _) = believe(&setup, &frame, &out, &posteriors, &ledgers);
            planner.unexplained(&belief, &frame, world.joints())
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
}
