//! Grasps by others: what they are told of a look, and which object each of their grasps is of.

use std::time::Instant;

use anyhow::Result;
use grip_manip::GivenGrasp;

use super::Trial;
use super::belief::Belief;
use super::look::Seen;
use crate::graspers::{ForeignGrasp, GraspQuestion, Grasper, Target, Want};

impl Trial<'_> {
    /// Asks the grasp planner, if it is not our own, how to grip what is believed to be on the table. Nobody is asked where nothing that
    /// is to be packed is believed to be there.
    ///
    /// # Errors
    /// When the grasp planner fails ([`crate::graspers::GrasperFailed`]), or the segmentation that it wants cannot be drawn.
    pub fn ask_for_grasps(&mut self, seen: &Seen, belief: &mut Belief) -> Result<()> {
        let Grasper::Other { planner, .. } = self.options.grasper.clone() else { return Ok(()) };
        let mut by_object = vec![Vec::new(); belief.scene.objects.len()];
        let open = self.open_items();
        let wanted = |i: usize| open.contains(&i) && on_table(belief, i).is_some();
        let asking: Vec<usize> = open.iter().copied().filter(|&i| wanted(i)).collect();
        if !asking.is_empty() {
            self.progress.message(&format!("look {}: asking for grasps", self.number() + 1));
            let clock = Instant::now();
            let targets: Vec<Target> = seen
                .asked
                .iter()
                .map(|&index| Target {
                    index,
                    obj_id: self.setup.models[index].info.bop_id,
                    wanted: asking.contains(&index),
                    pose: on_table(belief, index).map(|b| {
                        seen.frame.world_from_camera.inverse() * belief.scene.objects[b].world_from_object
                    }),
                })
                .collect();
            let segmentation = match planner.wants().contains(&Want::Segmentation) {
                true => {
                    let believed = seen.asked.iter().filter_map(|&i| {
                        Some((i, belief.scene.objects[on_table(belief, i)?].world_from_object))
                    });
                    Some(self.outlines(&seen.frame, believed.collect::<Vec<_>>().into_iter())?)
                }
                false => None,
            };
            let found = planner.grasps(&GraspQuestion {
                frame: &seen.frame,
                look: self.number(),
                targets: &targets,
                segmentation: segmentation.as_ref(),
                seed: self.setup.seed,
            })?;
            self.assign(seen, belief, found, &mut by_object);
            let share = clock.elapsed().as_secs_f64() / asking.len() as f64;
            asking.iter().for_each(|&i| self.records[i].plan_s += share);
        }
        belief.grasps = Some(by_object);
        Ok(())
    }

    /// Each grasp to the object that it is meant for, or else to the one that is believed to be between the fingers. A grasp of nothing
    /// that is believed to be there is left out.
    fn assign(
        &self,
        seen: &Seen,
        belief: &Belief,
        found: Vec<ForeignGrasp>,
        by_object: &mut [Vec<GivenGrasp>],
    ) {
        let (meant, given): (Vec<Option<usize>>, Vec<GivenGrasp>) = found
            .into_iter()
            .map(|ForeignGrasp { camera_from_gripper, width, score, index, place }| {
                let world_from_gripper = seen.frame.world_from_camera * camera_from_gripper;
                (index, GivenGrasp { world_from_gripper, opening: width, score, place })
            })
            .unzip();
        let gripped = self.planner.gripped_objects(&belief.scene, &given);
        let count = given.len();
        for ((grasp, meant), gripped) in given.into_iter().zip(meant).zip(gripped) {
            let of = match meant {
                Some(index) => on_table(belief, index),
                None => gripped,
            };
            if let Some(b) = of {
                by_object[b].push(grasp);
            }
        }
        let assigned: Vec<usize> = by_object.iter().map(Vec::len).collect();
        log::debug!("look {}: {count} grasps, by object {assigned:?}", self.number());
    }
}

/// The position in the belief of the object `i` of the setup, if it is believed to be on the table.
fn on_table(belief: &Belief, i: usize) -> Option<usize> {
    let b = belief.index.iter().position(|&index| index == i)?;
    (!belief.scene.objects[b].packed).then_some(b)
}
