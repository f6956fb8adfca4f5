//! The hand and the object from near by, with what presses on the object.

use anyhow::Result;
use grip_physics::World;
use grip_sim::camera::Intrinsics;
use grip_sim::images::RgbImage;
use grip_sim::pose::{Camera, Pose, World as WorldFrame};
use grip_sim::render::{Lighting, RenderScene, Renderer};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::pictures;
use crate::pictures::camera::{lens, looking};

/// Directions that are tried: about the vertical, and above the horizon, degrees.
const AROUND: usize = 12;
const ABOVE_DEG: [f64; 3] = [12.0, 30.0, 50.0];
/// How wide the lens is, degrees.
const WIDE_DEG: f64 = 34.0;
/// Size of the pictures by which a direction is chosen.
const TRIED: [usize; 2] = [80, 60];
/// About the middle between the pads, metres: the fingers.
const FINGERS_M: f64 = 0.075;
/// About an object that no hand is at, metres.
const ABOUT_M: f64 = 0.06;
/// A contact is hidden if something lies this far before it, metres: more than a finger is thick.
const BEFORE_M: f64 = 0.03;
/// Of each finger: right, left.
const COLORS: [[u8; 3]; 2] = [[255, 70, 200], [0, 225, 255]];

/// A finger's press on an object.
#[derive(Debug, Clone, Copy)]
pub struct Press {
    /// 0 is the right finger, 1 the left one.
    finger: usize,
    /// The middle of where they touch, world frame, metres.
    at: Point3<f64>,
    /// Normal force on the object, newtons, world frame.
    force: Vector3<f64>,
}

impl Press {
    /// Its force, newtons.
    pub fn newtons(&self) -> f64 {
        self.force.norm()
    }
}

/// What a close-up is of.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The object's label in pictures.
    label: u16,
    /// Balls that are to be in the picture.
    balls: Vec<(Point3<f64>, f64)>,
    /// The fingers close along this, world frame.
    closing: Vector3<f64>,
    /// Of the fingers on any object.
    pub presses: Vec<Press>,
}

impl Subject {
    /// Body `body` of the world as it stands, with the hand if `hand` is given: the pose of its frame.
    pub fn new(world: &World, body: usize, hand: Option<&Isometry3<f64>>) -> Self {
        let model = world.object(body);
        // Alone, an object is shown with what is about it.
        let about = if hand.is_none() { ABOUT_M } else { 0.0 };
        let mut balls = vec![(Point3::from(world.truth(body).translation()), 0.5 * model.diameter + about)];
        // An object that lies elsewhere has been lost: then the hand alone would say nothing.
        let near = |hand: &&Isometry3<f64>| {
            let apart = (hand.translation.vector - balls[0].0.coords).norm();
            apart < 0.5 * model.diameter + 0.5
        };
        let hand = hand.filter(near);
        balls.extend(hand.map(|hand| (Point3::from(hand.translation.vector), FINGERS_M)));
        let press = |(finger, contact): (usize, &grip_physics::BodyContact)| {
            Some(Press { finger, at: contact.middle()?, force: contact.force })
        };
        let presses = (0..world.object_count())
            .flat_map(|i| world.contacts(i).fingers.iter().enumerate().filter_map(press).collect::<Vec<_>>())
            .collect();
        let closing = hand.map_or_else(Vector3::zeros, |hand| hand * Vector3::y());
        Self { label: body as u16 + 1, balls, closing, presses }
    }

    /// The ball about all balls' bounds: middle and radius, metres.
    fn bounds(&self) -> (Vector3<f64>, f64) {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for (at, radius) in &self.balls {
            low = low.inf(&at.coords.add_scalar(-radius));
            high = high.sup(&at.coords.add_scalar(*radius));
        }
        let middle = 0.5 * (low + high);
        let reach = self.balls.iter().map(|(at, radius)| (at.coords - middle).norm() + radius);
        (middle, reach.fold(0.06, f64::max))
    }

    fn camera(&self, around_deg: f64, above_deg: f64) -> Pose<WorldFrame, Camera> {
        let (middle, radius) = self.bounds();
        let (around, above) = (around_deg.to_radians(), above_deg.to_radians());
        let direction = Vector3::new(around.cos() * above.cos(), around.sin() * above.cos(), above.sin());
        // The picture's height is three quarters of its width.
        let half = (0.75 * (0.5 * WIDE_DEG).to_radians().tan()).atan();
        looking(middle + direction * (radius / half.sin()), middle)
    }

    /// The camera that sees most of the object and of the contacts, if possible from beside the fingers.
    fn best_camera(
        &self,
        scene: &RenderScene,
        renderer: &mut dyn Renderer,
    ) -> Result<Pose<WorldFrame, Camera>> {
        let lens = lens(TRIED, WIDE_DEG);
        // Light is not needed to see what is in front.
        let (dark, mut best) = (Lighting::default(), None);
        for above in ABOVE_DEG {
            for k in 0..AROUND {
                let camera = self.camera(360.0 * k as f64 / AROUND as f64, above);
                let seen = renderer.render(scene, &dark, &lens, &camera)?;
                let object = seen.labels.data().iter().filter(|label| **label == self.label).count();
                let pixels = (TRIED[0] * TRIED[1]) as f64;
                let presses = self.presses.iter().filter(|press| {
                    let at = camera.inverse().transform_point(&press.at);
                    depth_at(&lens, &at, &seen.depth).is_some_and(|depth| depth > at.z - BEFORE_M)
                });
                let sight = camera.transform_vector(&Vector3::z());
                let beside = 1.0 - sight.dot(&self.closing).abs();
                let score = (object as f64 / pixels).sqrt() + 0.2 * presses.count() as f64 + 0.4 * beside;
                if best.as_ref().is_none_or(|(most, _)| score > *most) {
                    best = Some((score, camera));
                }
            }
        }
        Ok(best.map_or_else(|| self.camera(0.0, ABOVE_DEG[0]), |(_, camera)| camera))
    }

    /// Draws it: the picture, with the contacts on it, `draw` being what renders and develops.
    pub fn picture(
        &self,
        scene: &RenderScene,
        renderer: &mut dyn Renderer,
        size: [usize; 2],
        mut draw: impl FnMut(&mut dyn Renderer, &Intrinsics, &Pose<WorldFrame, Camera>) -> Result<RgbImage>,
    ) -> Result<RgbImage> {
        let camera = self.best_camera(scene, renderer)?;
        let lens = lens(size, WIDE_DEG);
        let mut picture = draw(renderer, &lens, &camera)?;
        let from_world = camera.inverse();
        let pixel = |p: Point3<f64>| lens.project(&from_world.transform_point(&p)).map(|p| [p.x, p.y]);
        for press in &self.presses {
            let newtons = press.newtons();
            let along = press.force / newtons.max(1e-9);
            // 2 cm, and half a millimetre a newton.
            let tail = press.at - along * (0.02 + 5e-4 * newtons).min(0.06);
            let (Some(head), Some(tail)) = (pixel(press.at), pixel(tail)) else { continue };
            let color = COLORS[press.finger];
            pictures::arrow(&mut picture, tail, head, 3.5, color);
            let off = [tail[0] - head[0], tail[1] - head[1]];
            let beyond = 1.0 + 38.0 / off[0].hypot(off[1]).max(8.0);
            let at = [head[0] + beyond * off[0], head[1] + beyond * off[1]];
            pictures::label(&mut picture, at, &format!("{newtons:.0} N"), [0; 3], color);
        }
        Ok(picture)
    }
}

fn depth_at(lens: &Intrinsics, at: &Point3<f64>, depth: &grip_sim::images::DepthImage) -> Option<f64> {
    let pixel = lens.project(at)?;
    let inside = |x: f64, length: usize| (x >= -0.5 && x < length as f64 - 0.5).then(|| x.round() as usize);
    Some(f64::from(*depth.at(inside(pixel.x, lens.width)?, inside(pixel.y, lens.height)?)))
}
