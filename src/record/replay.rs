//! A trial as an animated scene: bodies as they moved, estimates as ghosts, the hand's planned way as a line; contacts by the robot and
//! what was being done in the scene's extras.

use std::sync::Arc;

use anyhow::Result;
use grip_sim::mesh::Visual;
use grip_sim::scene::Scene;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

use super::glb::{Glb, Parts, Tint, Track};
use super::recorder::{Event, Recorder};
use super::rows::{Moved, Place};
use crate::setup::Setup;

/// Estimates that are acted by, and those that are not; a plan's line.
const BELIEVED: Tint = [0.1, 0.75, 0.3, 0.35];
const DOUBTED: Tint = [0.9, 0.4, 0.1, 0.25];
const PLAN: Tint = [0.1, 0.45, 0.95, 1.0];

/// What there is to draw.
#[derive(Debug)]
pub struct Drawn {
    /// World from mesh of what never moves.
    pub furniture: Parts,
    /// By link.
    pub links: Vec<Parts>,
    /// By object.
    pub objects: Vec<Arc<Visual>>,
    /// Where one looks from, and at what, world frame, metres.
    view: [[f64; 3]; 2],
}

impl Drawn {
    /// All of a setup.
    pub fn of(setup: &Setup) -> Self {
        let links = setup.cell.robot.links().iter();
        let parts =
            links.map(|link| link.visuals.iter().map(|part| (part.pose, part.visual.clone())).collect());
        Self {
            furniture: setup.camera.furniture().drawn.clone(),
            links: parts.collect(),
            objects: setup.models.iter().map(|model| model.visual.clone()).collect(),
            view: view(&setup.cell.scene),
        }
    }
}

/// From across the table and its left, where robot, objects and bin are seen.
fn view(scene: &Scene) -> [[f64; 3]; 2] {
    let table = Vector3::new(scene.table.center[0], scene.table.center[1], scene.table.height);
    let mut away = table - scene.world_from_base().translation();
    away.z = 0.0;
    let away = away.try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let eye = table + away * 1.5 + Vector3::z().cross(&away) * 0.9 + Vector3::z() * 1.0;
    let target = table - away * 0.15 + Vector3::z() * 0.2;
    [eye.into(), target.into()]
}

/// The file.
///
/// # Errors
/// When a texture cannot be encoded.
pub fn glb(recorder: &Recorder, drawn: &Drawn) -> Result<Vec<u8>> {
    let mut glb = Glb::new();
    for (k, part) in drawn.furniture.iter().enumerate() {
        glb.still(&format!("furniture/{k}"), &Isometry3::identity(), &vec![part.clone()])?;
    }
    let period = 1.0 / recorder.options.rate_hz as f32;
    let track = |kind: &str, name: &str, instance: i64| {
        let rows = recorder.moved.iter();
        let own = rows.filter(|row| row.kind == kind && row.name == name && row.instance == instance);
        keys(own, period)
    };
    for (name, parts) in recorder.links.iter().zip(&drawn.links).filter(|(_, parts)| !parts.is_empty()) {
        glb.moving(&format!("link/{name}"), parts, &track("link", name, 1))?;
    }
    let parts: Vec<Parts> =
        drawn.objects.iter().map(|visual| vec![(Isometry3::identity(), visual.clone())]).collect();
    for ((name, instance), parts) in recorder.objects.iter().zip(&parts) {
        let track = track("object", name, *instance);
        glb.moving(&format!("object/{}", numbered(name, *instance)), parts, &track)?;
    }
    let end = recorder.moved.iter().map(|row| row.time_s as f32).fold(0.0, f32::max);
    let looks: Vec<f32> = recorder.look_times().collect();
    for event in &recorder.events {
        let Event::Estimate(row) = event else { continue };
        let body = recorder.objects.iter().position(|of| *of == (row.object.clone(), row.instance));
        let (Some(body), Some(place)) = (body, row.estimate) else { continue };
        let from = row.time_s as f32;
        let to = looks.iter().copied().find(|time| *time > from).unwrap_or(end);
        let name = format!("estimate/{}/{}", row.look, numbered(&row.object, row.instance));
        let tint = if row.believed { BELIEVED } else { DOUBTED };
        glb.ghost(&name, (&isometry(&place), &parts[body]), tint, (from, to))?;
    }
    for event in &recorder.events {
        let Event::Attempt(row) = event else { continue };
        let way = recorder.planned.0.iter().filter(|planned| planned.attempt == row.attempt);
        let way: Vec<[f32; 3]> = way.map(|planned| planned.hand).collect();
        glb.line(&format!("plan/{}", row.attempt), &way, PLAN, (row.begin_s as f32, row.end_s as f32));
    }
    glb.finish(extras(recorder, drawn))
}

/// What the page's viewer shows beside: seconds; metres, newtons.
fn extras(recorder: &Recorder, drawn: &Drawn) -> Value {
    let rounded = |v: f32| (f64::from(v) * 1e4).round() / 1e4;
    let contacts = recorder.contacts.iter().filter(|row| recorder.is_robot(&row.by)).map(|row| {
        let [x, y, z] = row.point.map(rounded);
        let [fx, fy, fz] = row.force_n.map(rounded);
        json!([rounded(row.time_s as f32), x, y, z, fx, fy, fz])
    });
    let said = recorder.events.iter().filter_map(|event| match event {
        Event::Look(row) => Some(json!([row.time_s, format!("look {}: {}", row.look + 1, row.decision)])),
        Event::Attempt(row) if !row.done => {
            Some(json!([row.end_s, format!("{} {}: {}", row.failed_step, row.object, row.reason)]))
        }
        _ => None,
    });
    let steps = recorder.events.iter().filter_map(|event| match event {
        Event::Step(row) => Some(json!([row.begin_s, row.end_s, row.step])),
        _ => None,
    });
    json!({
        "view": drawn.view,
        "contacts": contacts.collect::<Vec<_>>(),
        "captions": said.collect::<Vec<_>>(),
        "steps": steps.collect::<Vec<_>>(),
    })
}

/// Keys of a body: where it rests it has one at the beginning and one at the end of the rest.
fn keys<'a>(rows: impl Iterator<Item = &'a Moved>, period: f32) -> Track {
    let mut track: Track = Vec::new();
    for row in rows {
        let time = row.time_s as f32;
        if let Some(&(before, position, rotation)) = track.last()
            && time - before > 1.5 * period
        {
            track.push((time - period, position, rotation));
        }
        let mut rotation = row.rotation;
        // The nearer of the two quaternions of a turn, so that nothing spins between.
        if let Some((.., last)) = track.last()
            && last.iter().zip(rotation).map(|(a, b)| a * b).sum::<f32>() < 0.0
        {
            rotation = rotation.map(|part| -part);
        }
        // Seconds must grow.
        if track.last().is_none_or(|last| time > last.0) {
            track.push((time, row.position, rotation));
        }
    }
    track
}

fn isometry(place: &Place) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(place.qw, place.qx, place.qy, place.qz));
    Isometry3::from_parts(Translation3::new(place.x, place.y, place.z), rotation)
}

/// An object's name, with its number where it is not the first of that name.
pub(super) fn numbered(name: &str, instance: i64) -> String {
    if instance == 1 { name.to_owned() } else { format!("{name} ({instance})") }
}
