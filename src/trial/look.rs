//! Looking: what the camera sees, what is estimated from it, and where each thing is then believed to be.

use std::time::Instant;

use anyhow::Result;
use grip_perception::PosePosterior;
use grip_physics::World;
use grip_sim::frame::CameraFrame;
use grip_sim::images::LabelImage;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose, World as WorldFrame};
use grip_sim::render::{Instance, RenderScene};
use nalgebra::Point3;

use super::report::LookPictures;
use super::{Pictures, Trial};
use crate::estimators::{Estimates, Estimator, Look, told_apart};
use crate::graspers::Grasper;
use crate::pictures;
use crate::score;
use crate::score::record::ItemRecord;

/// What a look has shown.
pub struct Seen {
    /// What the camera saw.
    pub frame: CameraFrame,
    /// The objects that were looked for, positions in the setup's list.
    pub asked: Vec<usize>,
    /// What is estimated of them.
    pub estimates: Estimates,
    /// ADD and ADD-S of those estimates by object, metres; for the score alone.
    pub(super) errors: Vec<Option<(f64, f64)>>,
}

/// Share of an object's vertices that the picture would hold, hidden ones too.
fn share_in_view(frame: &CameraFrame, model: &ObjectModel, camera_from_object: &Pose<Camera, Object>) -> f64 {
    let k = &frame.intrinsics;
    let (width, height) = (k.width as f64 - 0.5, k.height as f64 - 0.5);
    let positions = &model.visual.mesh.positions;
    let inside = positions.iter().filter(|p| {
        let seen = k.project(&camera_from_object.transform_point(&p.cast()));
        seen.is_some_and(|at| (-0.5..width).contains(&at.x) && (-0.5..height).contains(&at.y))
    });
    inside.count() as f64 / positions.len().max(1) as f64
}

impl Trial<'_> {
    /// Looks, estimates everything that is not believed to be in the bin, and looks again at what is. Where it is not sure
    /// which of two ways an object lies, and the settings want it, it goes elsewhere first and looks a second time.
    ///
    /// # Errors
    /// When renderer, detector or estimator fail.
    pub fn look(&mut self) -> Result<Seen> {
        let first = self.see(false)?;
        let Some(doubtful) = self.in_doubt(&first) else { return Ok(first) };
        if !self.goes_to_second_view(&first, &doubtful) {
            return Ok(first);
        }
        self.picture(&first, "looks again from elsewhere".to_owned())?;
        let mut second = self.see(true)?;
        self.keep_what_is_out_of_view(&first, &mut second);
        Ok(second)
    }

    /// Where the open item is that may as well lie in a second way, if one may: the one in most doubt.
    fn in_doubt(&self, seen: &Seen) -> Option<Point3<f64>> {
        let settings = &self.setup.settings;
        let least = settings.trial.second_look_mass;
        if least == 0.0 {
            return None;
        }
        let open = self.open_items();
        let confident = |posterior: &PosePosterior| posterior.confidence >= settings.belief.least_confidence;
        let doubts = seen
            .estimates
            .iter()
            .filter(|(i, posterior)| open.contains(i) && confident(posterior))
            .map(|(_, posterior)| (posterior.doubt(), posterior))
            .filter(|(doubt, _)| *doubt >= least);
        let (_, posterior) = doubts.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Point3::from((seen.frame.world_from_camera * posterior.best).translation()))
    }

    /// Lowers the torso and looks at a point; false where there is no way, and then the robot stays.
    fn goes_to_second_view(&mut self, seen: &Seen, point: &Point3<f64>) -> bool {
        let torso = self.setup.settings.trial.second_look_torso_m;
        let Ok(Some(goal)) = self.setup.cell.looking_at(point, torso) else { return false };
        let belief = self.believe(seen);
        self.moves(&belief, &goal, "second view")
    }

    /// What the second view does not show is where the first one had it.
    fn keep_what_is_out_of_view(&mut self, first: &Seen, second: &mut Seen) {
        let least = self.setup.settings.belief.least_confidence;
        let now_from_then = second.frame.world_from_camera.inverse() * first.frame.world_from_camera;
        for (i, before) in first.estimates.iter().filter(|(_, before)| before.confidence >= least) {
            let lost = |(of, now): &&mut (usize, PosePosterior)| of == i && now.confidence < least;
            if let Some((_, now)) = second.estimates.iter_mut().find(lost) {
                *now = before.seen_from(&now_from_then);
                second.errors[*i] = first.errors[*i];
                if self.records[*i].attempts == 0 {
                    self.records[*i].record_errors(first.errors[*i]);
                }
            }
        }
        self.before.clone_from(&second.estimates);
    }

    /// One look from where the camera is; `again` when nothing has been handled since the last one.
    fn see(&mut self, again: bool) -> Result<Seen> {
        let packed = self.records.iter().filter(|record| record.believed_packed.is_some()).count();
        self.progress.message(&format!(
            "look {}: estimating poses ({packed} of {} packed)",
            self.cameras.len() + 1,
            self.items
        ));
        let (setup, shot) = (self.setup, self.cameras.len());
        // By true poses only depth is looked at, for what else is in the way; a picture is most of such a trial's work.
        let colour = !matches!(self.estimator, Estimator::Truth)
            || matches!(self.options.grasper, Grasper::Other { .. })
            || matches!(self.options.pictures, Pictures::All { .. })
            || self.recorder.is_full();
        let clock = Instant::now();
        let frame = match colour {
            true => setup.capture(&self.world, self.renderer, shot)?.0,
            false => setup.capture_depth(&self.world, self.renderer, shot)?,
        };
        self.recorder.looks(&frame, &self.world);
        self.recorder.took("picture", None, clock.elapsed());
        self.cameras.push(frame.world_from_camera);
        let in_bin = |record: &ItemRecord| record.believed_packed.is_some();
        let (inside, asked): (Vec<usize>, Vec<usize>) =
            (0..self.records.len()).partition(|&i| in_bin(&self.records[i]));
        let clock = Instant::now();
        let estimates = self.estimate(&frame, &asked, again, false)?;
        self.recorder.took("estimate", None, clock.elapsed());
        let mut believed = vec![None; self.records.len()];
        for (i, posterior) in &estimates {
            believed[*i] = Some(frame.world_from_camera * posterior.best);
        }
        self.bodies.assign(&self.world, &believed, |i| self.records[i].believed_packed.is_some());
        let mut errors = vec![None; self.records.len()];
        for (i, posterior) in &estimates {
            let record = &mut self.records[*i];
            record.estimate_s += posterior.seconds;
            let body = self.bodies.of(*i);
            let truth = frame.world_from_camera.inverse() * self.world.truth(body);
            let error = score::pose_errors(self.world.object(body), &truth, &posterior.best);
            let believed = posterior.confidence >= setup.settings.belief.least_confidence;
            self.recorder.estimated((body, &self.world), (&frame, posterior), error, (false, believed));
            errors[*i] = Some(error);
            // After an attempt the errors of the look before it stay.
            if record.attempts == 0 {
                record.record_errors(errors[*i]);
            }
        }
        if !inside.is_empty() {
            let clock = Instant::now();
            let there = self.estimate(&frame, &inside, again, true)?;
            self.recorder.took("estimate_in_bin", None, clock.elapsed());
            self.correct_places(&frame, &there);
        }
        self.before.clone_from(&estimates);
        Ok(Seen { frame, asked, estimates, errors })
    }

    /// What the estimator says of the objects `asked`, on the table or in the bin.
    fn estimate(&self, frame: &CameraFrame, asked: &[usize], again: bool, in_bin: bool) -> Result<Estimates> {
        let Self { setup, cameras, before, world, .. } = self;
        let models = &setup.models;
        let look = Look { frame, cameras, before, models, asked, again, seed: setup.seed };
        let estimates = match self.estimator {
            Estimator::Perception(perception) if in_bin => perception.look_into_bin(&look)?,
            Estimator::Perception(perception) => perception.look(&look)?,
            Estimator::Truth => truth(world, &setup.true_camera(world), asked),
        };
        let least = setup.settings.belief.least_confidence;
        let confident = |posterior: &PosePosterior| posterior.confidence >= least;
        let last = cameras.len().checked_sub(2).map(|look| cameras[look]);
        let known = |i: usize| {
            if in_bin {
                return self.records[i].believed_packed;
            }
            let (_, posterior) = before.iter().find(|(of, posterior)| *of == i && confident(posterior))?;
            Some(last? * posterior.best)
        };
        Ok(told_apart(estimates, models, &frame.world_from_camera, confident, known))
    }

    /// Corrects where items lie in the bin: things tip over when they are let go, and the next place is planned around them.
    /// A pose that is not confident, not in the bin, far from where the item was put or partly out of the picture is not taken.
    fn correct_places(&mut self, frame: &CameraFrame, estimates: &Estimates) {
        let settings = &self.setup.settings.belief;
        for (i, posterior) in estimates {
            let record = &mut self.records[*i];
            record.estimate_s += posterior.seconds;
            let pose = frame.world_from_camera * posterior.best;
            let centre = Point3::from(pose.translation());
            let moved = record
                .believed_packed
                .map_or(f64::INFINITY, |put| (put.translation() - centre.coords).norm());
            let model = &self.setup.models[*i];
            let sure = matches!(self.estimator, Estimator::Truth)
                || share_in_view(frame, model, &posterior.best) >= settings.in_view;
            let believed = sure
                && posterior.confidence >= settings.least_confidence
                && moved < settings.moved_in_bin_m
                && self.setup.cell.scene.bin.contains(&centre, settings.over_bin_m);
            if self.recorder.is_on() {
                let body = self.bodies.of(*i);
                let truth = frame.world_from_camera.inverse() * self.world.truth(body);
                let error = score::pose_errors(model, &truth, &posterior.best);
                self.recorder.estimated((body, &self.world), (frame, posterior), error, (true, believed));
            }
            if believed {
                record.believed_packed = Some(pose);
            }
        }
    }

    /// Keeps the pictures of a look, if all are wanted: the believed poses as outlines on the frame.
    pub(super) fn picture(&mut self, seen: &Seen, caption: String) -> Result<()> {
        if !matches!(self.options.pictures, Pictures::All { .. }) {
            return Ok(());
        }
        let least = self.setup.settings.belief.least_confidence;
        let frame = &seen.frame;
        let believed = seen.estimates.iter().filter(|(_, posterior)| posterior.confidence >= least);
        let outlines = self
            .outlines(frame, believed.map(|(i, posterior)| (*i, frame.world_from_camera * posterior.best)))?;
        self.looks.push(LookPictures {
            caption,
            rgb: frame.rgb.clone(),
            depth: frame.depth.clone(),
            overlay: pictures::outlines(&frame.rgb, &outlines),
            asked: seen.asked.clone(),
            world_from_camera: frame.world_from_camera,
        });
        Ok(())
    }

    /// Labels of objects drawn alone at believed poses, as the camera of `frame` would see them.
    pub(super) fn outlines(
        &mut self,
        frame: &CameraFrame,
        believed: impl Iterator<Item = (usize, Pose<WorldFrame, Object>)>,
    ) -> Result<LabelImage> {
        let instance = |(i, pose): (usize, Pose<WorldFrame, Object>)| Instance {
            visual: self.setup.models[i].visual.clone(),
            pose: *pose.iso(),
            label: i as u16 + 1,
        };
        let scene = RenderScene { instances: believed.map(instance).collect(), bounce: None };
        let lighting = &self.setup.condition.lighting;
        let rendering =
            self.renderer.render(&scene, lighting, &frame.intrinsics, &frame.world_from_camera)?;
        Ok(rendering.labels)
    }
}

/// Perfect posteriors of the objects `asked`, as a camera there sees them: where the robot believes it to be elsewhere, it believes the
/// same of the objects.
pub(super) fn truth(
    world: &World,
    world_from_camera: &Pose<WorldFrame, Camera>,
    asked: &[usize],
) -> Estimates {
    let camera_from_world = world_from_camera.inverse();
    let certain = |&i: &usize| {
        let pose = camera_from_world * world.truth(i);
        (i, PosePosterior::certain(&world.object(i).info.name, pose))
    };
    asked.iter().map(certain).collect()
}
