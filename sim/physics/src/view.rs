//! What the camera sees of the world: furniture, robot and objects as posed meshes.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::world::World;
use grip_sim::mesh::Visual;
use grip_sim::render::{Instance, RenderScene};

/// Label of every robot link. Objects are 1, 2, .. in the scene's order; furniture is 0. All fit an 8-bit picture.
pub const ROBOT_LABEL: u16 = 255;

impl World {
    /// Everything there is to draw, as it stands now. `furniture` comes from [`grip_sim::render::furniture`].
    pub fn render_scene(&self, furniture: &[(Isometry3<f64>, Arc<Visual>)]) -> RenderScene {
        let mut instances: Vec<Instance> = furniture
            .iter()
            .map(|(pose, visual)| Instance { visual: visual.clone(), pose: *pose, label: 0 })
            .collect();
        for (index, link) in self.robot_model.links().iter().enumerate() {
            for drawn in &link.visuals {
                instances.push(Instance {
                    visual: drawn.visual.clone(),
                    pose: self.robot.link_poses[index] * drawn.pose,
                    label: ROBOT_LABEL,
                });
            }
        }
        for index in 0..self.object_count() {
            instances.push(Instance {
                visual: self.object(index).visual.clone(),
                pose: *self.truth(index).iso(),
                label: index as u16 + 1,
            });
        }
        RenderScene { instances, bounce: None }
    }
}
