//! Dropping objects on the table from a seed, and letting physics settle them.

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::error::{Error, Result};
use crate::settings::PlacementSettings;
use crate::world::{Placed, World};
use grip_sim::condition::{Clutter, Placement};
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{self as frame, Pose};
use grip_sim::rng;
use grip_sim::scene::{ObjectPlacement, PlacedObject, Scene, Table};

/// What a layout must meet beyond lying well on the table, such as being seen; the reason why it does not.
#[derive(Clone, Copy)]
pub struct Accept<'a> {
    /// Asked often, so that no time is lost on what will not do: of what is about to be spread; of clutter before each object,
    /// with that alone, and after it, with those laid so far.
    pub glance: &'a dyn Fn(&[Placed]) -> LaidOut,
    /// Asked of the whole layout at rest.
    pub look: &'a dyn Fn(&[Placed]) -> LaidOut,
}

impl Accept<'_> {
    /// Every layout will do.
    pub const ALL: Self = Self { glance: &|_| Ok(()), look: &|_| Ok(()) };
}

/// Whether something could be laid out; else why not.
pub type LaidOut = std::result::Result<(), String>;

/// How the objects got where they are.
#[derive(Debug, Clone, PartialEq)]
pub struct Dropped {
    /// Layouts that were thrown away, with the reason.
    pub rejected: Vec<String>,
    /// Simulated seconds until rest.
    pub settle_s: f64,
}

/// Drops `models` into the scene's region and settles them; builds the world anew for each attempt with `fresh`.
///
/// Spread: upright or (for the scene's share) on a side, turned about the vertical by a random angle, outlines apart by
/// the scene's gap. Stacked: one after another in random orientations on a smaller patch. A layout in which something
/// falls off the table, into the bin, or does not come to rest is thrown away; when spread, also one in which objects
/// rolled against each other; and one that `accept` refuses.
///
/// # Errors
/// When no layout succeeds: the message holds the reasons and what to change. When a setting is out of its range.
pub fn drop_objects(
    scene: &Scene,
    models: &[Arc<ObjectModel>],
    placement: Placement,
    settings: &PlacementSettings,
    seed: u64,
    accept: Accept<'_>,
    mut fresh: impl FnMut() -> Result<World>,
) -> Result<(World, Dropped)> {
    settings.validate().map_err(|message| Error::World(format!("placement settings: {message}")))?;
    let places = scene.objects.places(models.iter().map(|model| model.info.name.as_str()));
    // Where nothing is left to chance, each attempt is the same.
    let given = !places.is_empty() && places.iter().all(Option::is_some);
    let once = PlacementSettings { attempts: 1, draws: 1, ..settings.clone() };
    let settings = if given { &once } else { settings };
    let layout = Layout { scene, models, settings, accept };
    let PlacementSettings { attempts, settle_s: limit_s, .. } = *settings;
    let mut rejected = Vec::new();
    for attempt in 0..attempts {
        let mut random = rng::stream(seed, &format!("placement/{attempt}"));
        let mut world;
        let laid_out = match placement {
            Placement::Spread => {
                let Some(placed) = layout.spread(&mut random, &mut rejected) else {
                    continue;
                };
                world = fresh()?;
                for (model, pose) in placed {
                    world.add_object(model, &pose)?;
                }
                layout.freeze(&mut world);
                Ok(())
            }
            Placement::Stacked(clutter) => {
                world = fresh()?;
                layout.stack(&mut world, clutter, &mut random)?
            }
        };
        let outcome = laid_out.and_then(|()| {
            let began = world.time();
            if placement == Placement::Spread {
                layout.calm(&mut world, settings.fall_s, settings.fallen_s);
            }
            world.thin_air();
            if !layout.calm(&mut world, limit_s, settings.stands_s) {
                let speeds = (0..world.object_count()).map(|i| (world.speed(i), i));
                let restless = speeds.max_by(|a, b| a.0.total_cmp(&b.0));
                let (speed, i) = restless.unwrap_or((0.0, 0));
                let name = &world.object(i).info.name;
                return Err(format!("{name} still moves at {:.1} mm/s after {limit_s} s", speed * 1e3));
            }
            let settle_s = world.time() - began;
            let wrong = match placement {
                Placement::Spread => layout.touching(&world),
                Placement::Stacked(clutter) => too_loose(&world, clutter.touching),
            };
            layout.astray(&world).or(wrong).map_or_else(|| (accept.look)(&world.placed()), Err)?;
            Ok(settle_s)
        });
        match outcome {
            Ok(settle_s) => {
                world.reset_peaks();
                return Ok((world, Dropped { rejected, settle_s }));
            }
            Err(reason) => rejected.push(reason),
        }
    }
    if given {
        let reason = rejected.pop().unwrap_or_default();
        return Err(Error::NoLayout(format!(
            "the objects cannot be where objects.placed puts them: {reason}; give other poses"
        )));
    }
    Err(Error::NoLayout(format!(
        "no layout of {} objects in {attempts} attempts ({}); enlarge objects.size, lower objects.gap, or use fewer objects",
        models.len(),
        commonest(&rejected)
    )))
}

/// What is laid out, and what it must meet.
#[derive(Clone, Copy)]
struct Layout<'a> {
    scene: &'a Scene,
    models: &'a [Arc<ObjectModel>],
    settings: &'a PlacementSettings,
    accept: Accept<'a>,
}

impl Layout<'_> {
    /// The place of its own of each object, if it has one.
    fn places(&self) -> Vec<Option<&PlacedObject>> {
        self.scene.objects.places(self.models.iter().map(|model| model.info.name.as_str()))
    }

    fn freeze(&self, world: &mut World) {
        let places = self.places();
        let frozen = places.iter().enumerate().filter(|(_, place)| place.is_some_and(|place| place.frozen));
        frozen.for_each(|(index, _)| world.freeze(index));
    }

    /// Where objects that are spread out begin: a hand's breadth apart, and as `accept` wants it. Of the many ways to do that
    /// which a seed draws, the first that succeeds; why the others did not is added to `rejected`.
    fn spread(&self, random: &mut ChaCha8Rng, rejected: &mut Vec<String>) -> Option<Vec<Placed>> {
        (0..self.settings.draws).find_map(|_| {
            self.apart(random)
                .and_then(|placed| (self.accept.glance)(&placed).map(|()| placed))
                .map_err(|reason| rejected.push(reason))
                .ok()
        })
    }

    /// Objects with their outlines apart, just above the table.
    fn apart(&self, random: &mut ChaCha8Rng) -> std::result::Result<Vec<Placed>, String> {
        let Self { scene, models, settings, .. } = *self;
        let region = &scene.objects;
        let mut poses: Vec<_> = self.places().into_iter().map(|place| Some(place?.pose)).collect();
        // Fixed places are taken first, so that nothing is dropped on them.
        let mut outlines: Vec<([f64; 2], f64)> = Vec::new();
        for (model, pose) in models.iter().zip(&poses) {
            if let Some(pose) = pose {
                let p = pose.translation();
                outlines.push(([p.x, p.y], reach(model, &pose.rotation()).1));
            }
        }
        // The widest objects choose first, while there is room; they enter the world in the scene's order.
        let turned: Vec<_> = models
            .iter()
            .map(|model| {
                let rotation = orientation(model, region.lying_fraction, random);
                let (below, radius) = reach(model, &rotation);
                (rotation, below, radius)
            })
            .collect();
        let mut order: Vec<usize> = (0..models.len()).collect();
        order.sort_by(|&a, &b| turned[b].2.total_cmp(&turned[a].2));
        for i in order {
            if poses[i].is_some() {
                continue;
            }
            let (rotation, below, radius) = turned[i];
            let place = (0..settings.places).find_map(|_| {
                let at = somewhere(region, 1.0, random);
                let free = outlines.iter().all(|(other, r)| {
                    let apart = ((at[0] - other[0]).powi(2) + (at[1] - other[1]).powi(2)).sqrt();
                    apart >= radius + r + region.gap
                });
                let clear = scene.bin.distance(at[0], at[1]) >= radius + region.gap.max(settings.bin_gap_m);
                if !(free && clear && inside(&scene.table, at[0], at[1], settings.edge_m)) {
                    return None;
                }
                Some((at, scene.ground(at[0], at[1], radius)?))
            });
            let Some(([x, y], ground)) = place else {
                return Err(format!("no free place for {}", models[i].info.name));
            };
            outlines.push(([x, y], radius));
            let z = ground + below + settings.drop_m;
            poses[i] = Some(Pose::new(Isometry3::from_parts(Translation3::new(x, y, z), rotation)));
        }
        Ok(models.iter().cloned().zip(poses.into_iter().flatten()).collect())
    }

    /// Lays the objects on and against each other, one after the other.
    fn stack(&self, world: &mut World, clutter: Clutter, random: &mut ChaCha8Rng) -> Result<LaidOut> {
        let Self { models, settings, accept, .. } = *self;
        for (model, place) in models.iter().zip(self.places()) {
            if let Some(place) = place {
                let index = world.add_object(model.clone(), &place.pose)?;
                if place.frozen {
                    world.freeze(index);
                }
                continue;
            }
            let laid_before = world.object_count();
            let mut laid = Err(String::new());
            for _ in 0..settings.falls {
                // What would not do if it lay alone there is not worth the fall.
                let start = (0..settings.starts).find_map(|_| {
                    let [alone, on_top] = self.start(world, laid_before, model, clutter, random);
                    laid = (accept.glance)(&[(model.clone(), alone)]);
                    laid.is_ok().then_some(on_top)
                });
                let Some(pose) = start else { continue };
                if world.object_count() == laid_before {
                    world.add_object(model.clone(), &pose)?;
                } else {
                    world.put(laid_before, &pose);
                }
                let at_rest = self.calm(world, settings.fall_s, settings.fallen_s);
                laid = match self.astray(world) {
                    Some(reason) => Err(reason),
                    None if at_rest || world.drift(settings.fallen_s) < settings.rolling_m => {
                        (accept.glance)(&world.placed())
                    }
                    None => Err(format!("{} rolls about", model.info.name)),
                };
                if laid.is_ok() {
                    break;
                }
            }
            if laid.is_err() {
                return Ok(laid);
            }
        }
        Ok(Ok(()))
    }

    /// A random place against one of the first `count` objects: the pose on the ground there, as if there were no other objects,
    /// and the one just above whatever lies there, from which the object is laid down and does not fall.
    fn start(
        &self,
        world: &World,
        count: usize,
        model: &ObjectModel,
        clutter: Clutter,
        random: &mut ChaCha8Rng,
    ) -> [Pose<frame::World, frame::Object>; 2] {
        let Self { scene, settings, .. } = *self;
        let region = &scene.objects;
        let rotation = orientation(model, clutter.lying_fraction, random);
        let (below, radius) = reach(model, &rotation);
        let [x, y] = match count {
            0 => somewhere(region, clutter.patch, random),
            _ => self.against(world, random.random_range(0..count), radius, clutter.patch, random),
        };
        // Over an edge or a slope it is dropped from where it clears all blocks, and comes to rest where it likes.
        let ground = scene.ground(x, y, radius).unwrap_or_else(|| scene.highest_ground());
        let top = world.highest_point_near(x, y, radius, count).max(ground);
        [ground, top].map(|z| {
            Pose::new(Isometry3::from_parts(Translation3::new(x, y, z + below + settings.drop_m), rotation))
        })
    }

    /// A point of the middle `share` of the region where something whose outline has `radius` would lie on or against object
    /// `index`.
    fn against(
        &self,
        world: &World,
        index: usize,
        radius: f64,
        share: f64,
        random: &mut ChaCha8Rng,
    ) -> [f64; 2] {
        let region = &self.scene.objects;
        let [least, most] = self.settings.clutter_distance;
        let pose = world.truth(index);
        let distance =
            random.random_range(least..most) * (radius + reach(world.object(index), &pose.rotation()).1);
        let direction = random.random_range(-std::f64::consts::PI..std::f64::consts::PI);
        let at = pose.translation().xy() + distance * Vector2::new(direction.cos(), direction.sin());
        [0, 1].map(|axis| {
            let half = share * region.size[axis] / 2.0;
            at[axis].clamp(region.center[axis] - half, region.center[axis] + half)
        })
    }

    /// Steps until nothing has moved for `rest_s` so that it could be seen, or `limit_s` is over; whether it came to that.
    fn calm(&self, world: &mut World, limit_s: f64, rest_s: f64) -> bool {
        (0..(limit_s / rest_s).ceil() as usize).any(|_| world.drift(rest_s) < self.settings.drift_m)
    }

    /// Two objects that rolled against each other, if any: spread out means apart, but for two that have places of their own.
    fn touching(&self, world: &World) -> Option<String> {
        let places = self.places();
        (0..world.object_count()).find_map(|i| {
            let mut others = world.contacts(i).objects.iter();
            let &other = others.find(|&&other| places[i].is_none() || places[other].is_none())?;
            Some(format!("{} rolled against {}", world.object(i).info.name, world.object(other).info.name))
        })
    }

    /// Which object, if any, is not well on the table.
    fn astray(&self, world: &World) -> Option<String> {
        let scene = self.scene;
        (0..world.object_count()).filter(|i| !world.is_frozen(*i)).find_map(|i| {
            let p = world.truth(i).translation();
            let name = &world.object(i).info.name;
            let Table { height, .. } = scene.table;
            if !inside(&scene.table, p.x, p.y, self.settings.edge_m) || p.z < height {
                return Some(format!("{name} fell off the table"));
            }
            // What is to be packed must not begin in the bin, nor lean on it.
            (scene.bin.distance(p.x, p.y) <= 0.0 || world.touches_bin(i))
                .then(|| format!("{name} came to rest at the bin"))
        })
    }
}

/// The commonest reasons, each with how often it was one; those that differ by numbers alone are one.
fn commonest(reasons: &[String]) -> String {
    const TOLD: usize = 5;
    let mut kinds: Vec<(String, &String, usize)> = Vec::new();
    for reason in reasons {
        let kind: String = reason.chars().filter(|c| !c.is_ascii_digit()).collect();
        match kinds.iter_mut().find(|(known, ..)| *known == kind) {
            Some((.., times)) => *times += 1,
            None => kinds.push((kind, reason, 1)),
        }
    }
    kinds.sort_by_key(|(.., times)| std::cmp::Reverse(*times));
    let told: Vec<String> = kinds
        .iter()
        .take(TOLD)
        .map(|(_, reason, times)| format!("{times} times such as: {reason}"))
        .collect();
    let more = kinds.len().saturating_sub(TOLD);
    told.join("; ") + &if more > 0 { format!("; {more} more reasons") } else { String::new() }
}

/// What is wrong with clutter in which fewer objects touch another one than `share` of them.
fn too_loose(world: &World, share: f64) -> Option<String> {
    let count = world.object_count();
    let touching = (0..count).filter(|&i| !world.contacts(i).objects.is_empty()).count();
    ((touching as f64) < share * count as f64)
        .then(|| format!("only {touching} of {count} objects touch another one"))
}

fn inside(table: &Table, x: f64, y: f64, edge: f64) -> bool {
    let ([x0, y0], [x1, y1]) = (table.low(), table.high());
    (x0 + edge..=x1 - edge).contains(&x) && (y0 + edge..=y1 - edge).contains(&y)
}

/// Extents of the object's bounding box after a rotation: how far it reaches below its origin, and the radius of its
/// outline seen from above.
fn reach(model: &ObjectModel, rotation: &UnitQuaternion<f64>) -> (f64, f64) {
    let (mut below, mut radius) = (0.0_f64, 0.0_f64);
    for p in &model.visual.mesh.positions {
        let q = rotation * p.coords.cast::<f64>();
        below = below.max(-q.z);
        radius = radius.max(q.xy().norm());
    }
    (below, radius)
}

/// Upright, or rolled on a side.
fn orientation(model: &ObjectModel, lying_fraction: f64, random: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    let yaw = random.random_range(-std::f64::consts::PI..std::f64::consts::PI);
    let lies = random.random::<f64>() < lying_fraction && !model.info.upright;
    let about_x = random.random::<bool>();
    let side = if !lies {
        UnitQuaternion::identity()
    } else {
        let axis = if about_x { Vector3::x_axis() } else { Vector3::y_axis() };
        UnitQuaternion::from_axis_angle(&axis, std::f64::consts::FRAC_PI_2)
    };
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * side
}

/// A point of the region, or of its middle `share`.
fn somewhere(region: &ObjectPlacement, share: f64, random: &mut ChaCha8Rng) -> [f64; 2] {
    [0, 1].map(|axis| {
        let half = share * region.size[axis] / 2.0;
        region.center[axis] + random.random_range(-half..=half)
    })
}
