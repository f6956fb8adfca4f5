//! What there is to see in space. Each topic's last message says all that is to be seen of it, so that a viewer may jump.

use std::collections::BTreeMap;

use anyhow::Result;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::models::Models;
use super::proto::Bytes;
use super::schemas::{
    ArrowPrimitive, CubePrimitive, DeletionType, LinePrimitive, LineType, ModelPrimitive, SceneEntity,
    SceneEntityDeletion, SceneUpdate, TextPrimitive,
};
use super::source::{Estimate, Source};
use super::{
    Out, WORLD, color, estimate_color, link_frame, numbered, object_frame, point, pose, timestamp, vector,
};

/// How long the arrow of a force is, metres a newton, and at most, metres.
const ARROW: (f64, f64) = (0.004, 0.25);
/// Axes of a grasp, metres.
const AXES: f64 = 0.06;
/// Colours of forces by the robot and by anything else, of a planned way, and of the place that is planned for an object.
const ROBOT: [f64; 4] = [0.9, 0.15, 0.1, 1.0];
const OTHER: [f64; 4] = [0.95, 0.7, 0.1, 1.0];
const WAY: [f64; 4] = [0.1, 0.45, 0.95, 1.0];
const PLACE: [f64; 4] = [0.1, 0.45, 0.95, 0.25];

/// Says all of it.
///
/// # Errors
/// When a table or the animated scene lacks something.
pub fn tell(source: &Source, models: &Models<'_>, out: &mut Out) -> Result<()> {
    bodies(source, models, out)?;
    estimates(source, models, out)?;
    plans(source, models, out)?;
    contacts(source, out)
}

/// A message in place of all that was said before on its topic.
fn instead(time_s: f64, mut entities: Vec<SceneEntity>) -> SceneUpdate {
    let stamp = timestamp(time_s);
    entities.iter_mut().for_each(|entity| entity.timestamp = stamp.clone());
    let all = SceneEntityDeletion { timestamp: stamp, r#type: DeletionType::All, id: String::new() };
    SceneUpdate { deletions: vec![all], entities }
}

/// The meshes of all bodies, each in its frame.
fn bodies(source: &Source, models: &Models<'_>, out: &mut Out) -> Result<()> {
    let mut entities = Vec::new();
    let mut body = |id: &str, frame: String, names: &[&str]| -> Result<()> {
        let Some(data) = models.cut(names)? else { return Ok(()) };
        let model = ModelPrimitive {
            pose: pose(&Isometry3::identity()),
            scale: vector(&Vector3::repeat(1.0)),
            color: color([1.0; 4]),
            media_type: "model/gltf-binary".to_owned(),
            data: Bytes(data),
            ..Default::default()
        };
        entities.push(SceneEntity {
            frame_id: frame,
            id: id.to_owned(),
            frame_locked: true,
            models: vec![model],
            ..Default::default()
        });
        Ok(())
    };
    let furniture: Vec<&str> = models.names("furniture/").collect();
    body("furniture", WORLD.to_owned(), &furniture)?;
    for name in models.names("link/") {
        body(name, link_frame(name.trim_start_matches("link/")), &[name])?;
    }
    for (name, instance) in &source.about.objects {
        let frame = object_frame(name, *instance);
        body(&frame, frame.clone(), &[&frame])?;
    }
    let begin = source.moments.first().map_or(0.0, |moment| moment.time_s);
    out.say("/scene", begin, &instead(begin, entities));
    Ok(())
}

/// The box around an object, in its frame: its middle and its size.
fn around(models: &Models<'_>, frame: &str) -> Result<Option<(Vector3<f64>, Vector3<f64>)>> {
    let vertices = models.vertices(frame)?;
    let Some(first) = vertices.first() else { return Ok(None) };
    let (low, high) = vertices.iter().fold((first.coords, first.coords), |(low, high), vertex| {
        (low.inf(&vertex.coords), high.sup(&vertex.coords))
    });
    Ok(Some(((low + high) / 2.0, high - low)))
}

fn cube(
    world_from_object: &Isometry3<f64>,
    (middle, size): &(Vector3<f64>, Vector3<f64>),
    color: super::Color,
) -> CubePrimitive {
    let pose = pose(&(world_from_object * Translation3::from(*middle)));
    CubePrimitive { pose, size: vector(size), color }
}

/// A box for each estimate of a look, with its name.
fn estimates(source: &Source, models: &Models<'_>, out: &mut Out) -> Result<()> {
    for look in &source.looks {
        let mut entities = Vec::new();
        for estimate in source.estimates.iter().filter(|estimate| estimate.look == look.look) {
            let frame = object_frame(&estimate.object, estimate.instance);
            let Some(around) = around(models, &frame)? else { continue };
            let name = numbered(&estimate.object, estimate.instance);
            let above =
                estimate.pose * Point3::from(around.0) + Vector3::z() * (0.5 * around.1.norm() + 0.02);
            let text = TextPrimitive {
                pose: pose(&Translation3::from(above.coords).into()),
                billboard: true,
                font_size: 0.02,
                color: estimate_color(estimate.believed, 1.0),
                text: format!("{name} {:.2}", estimate.confidence),
                ..Default::default()
            };
            entities.push(SceneEntity {
                frame_id: WORLD.to_owned(),
                id: format!("estimate/{name}"),
                cubes: vec![cube(&estimate.pose, &around, estimate_color(estimate.believed, 0.35))],
                texts: vec![text],
                ..Default::default()
            });
        }
        out.say("/scene/estimates", look.time_s, &instead(look.time_s, entities));
    }
    Ok(())
}

/// While an attempt goes on: the hand's way, the grasp's axes (x red, y green, z blue), and where the object is to lie.
fn plans(source: &Source, models: &Models<'_>, out: &mut Out) -> Result<()> {
    let (attempts, planned, plans) = (&source.attempts, &source.planned, &source.plans);
    let (begins, ends) = (attempts.seconds("begin_s")?, attempts.seconds("end_s")?);
    let (numbers, looks) = (attempts.whole("attempt")?, attempts.whole("look")?);
    let (objects, instances) = (attempts.text("object")?, attempts.whole("instance")?);
    let actions = attempts.text("action")?;
    let (of, hands) = (planned.whole("attempt")?, planned.vectors("hand")?);
    let (plan_looks, found, plan_actions) =
        (plans.whole("look")?, plans.yes("found")?, plans.text("action")?);
    let (plan_objects, plan_instances) = (plans.text("object")?, plans.whole("instance")?);
    let (grasps, places) = (plans.places("grasp")?, plans.places("place")?);
    for row in 0..attempts.rows {
        let (object, instance, look) = (&objects[row], instances[row], looks[row]);
        let way: Vec<Point3<f64>> = of
            .iter()
            .zip(&hands)
            .filter(|(of, _)| **of == numbers[row])
            .map(|(_, hand)| (*hand).into())
            .collect();
        let mut entities = vec![line("plan/way", LineType::Strip, &way, vec![], WAY)];
        let plan = (0..plans.rows).rev().find(|&n| {
            found[n]
                && (plan_looks[n], plan_instances[n]) == (look, instance)
                && (&plan_objects[n], &plan_actions[n]) == (object, &actions[row])
        });
        let same = |estimate: &&Estimate| {
            (estimate.look, estimate.instance) == (look, instance) && estimate.object == *object
        };
        let estimate = source.estimates.iter().find(same);
        if let (Some(grasp), Some(estimate)) = (plan.and_then(|n| grasps[n]), estimate) {
            entities.push(axes("plan/grasp", &(estimate.pose * grasp)));
        }
        let around = around(models, &object_frame(object, instance))?;
        if let (Some(place), Some(around)) = (plan.and_then(|n| places[n]), around) {
            entities.push(SceneEntity {
                frame_id: WORLD.to_owned(),
                id: "plan/place".to_owned(),
                cubes: vec![cube(&place, &around, color(PLACE))],
                ..Default::default()
            });
        }
        out.say("/scene/plan", begins[row], &instead(begins[row], entities));
        out.say("/scene/plan", ends[row], &instead(ends[row], Vec::new()));
    }
    Ok(())
}

fn line(
    id: &str,
    kind: LineType,
    points: &[Point3<f64>],
    colors: Vec<super::Color>,
    one: [f64; 4],
) -> SceneEntity {
    let line = LinePrimitive {
        r#type: kind,
        pose: pose(&Isometry3::identity()),
        thickness: 2.0,
        scale_invariant: true,
        points: points.iter().map(point).collect(),
        color: color(one),
        colors,
        ..Default::default()
    };
    SceneEntity { frame_id: WORLD.to_owned(), id: id.to_owned(), lines: vec![line], ..Default::default() }
}

fn axes(id: &str, at: &Isometry3<f64>) -> SceneEntity {
    let (mut points, mut colors) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        let mut tip = Point3::origin();
        tip[axis] = AXES;
        points.extend([at * Point3::origin(), at * tip]);
        let mut tint = [0.1, 0.1, 0.1, 1.0];
        tint[axis] = 0.9;
        colors.extend([color(tint), color(tint)]);
    }
    line(id, LineType::List, &points, colors, [1.0; 4])
}

/// An arrow for what each body does to an object at a moment: normal force and friction together, from where they act.
fn contacts(source: &Source, out: &mut Out) -> Result<()> {
    let table = &source.contacts;
    let (times, by) = (table.seconds("time_s")?, table.text("by")?);
    let points = table.vectors("point")?;
    let (forces, frictions) = (table.vectors("force_n")?, table.vectors("friction_n")?);
    let links = source.moments.iter().take(1).flat_map(|moment| &moment.moved);
    let links: Vec<&str> =
        links.filter(|((kind, ..), _)| kind == "link").map(|((_, name, _), _)| name.as_str()).collect();
    let robot = |name: &str| name.ends_with(" finger") || links.contains(&name);
    let mut moments: BTreeMap<u64, (f64, Vec<ArrowPrimitive>)> = BTreeMap::new();
    for moment in &source.moments {
        // Where nothing touches anything, that is said, too.
        moments.insert(super::nanoseconds(moment.time_s), (moment.time_s, Vec::new()));
    }
    for row in 0..table.rows {
        let force = Vector3::from(forces[row]) + Vector3::from(frictions[row]);
        let (_, arrows) =
            moments.entry(super::nanoseconds(times[row])).or_insert_with(|| (times[row], Vec::new()));
        let tint = if robot(&by[row]) { ROBOT } else { OTHER };
        arrows.extend(arrow(points[row], &force, tint));
    }
    let mut empty = false;
    for (time_s, arrows) in moments.into_values() {
        if arrows.is_empty() && empty {
            continue;
        }
        empty = arrows.is_empty();
        let entity = SceneEntity {
            frame_id: WORLD.to_owned(),
            id: "contacts".to_owned(),
            arrows,
            ..Default::default()
        };
        out.say("/scene/contacts", time_s, &instead(time_s, vec![entity]));
    }
    Ok(())
}

fn arrow(from: [f64; 3], force: &Vector3<f64>, tint: [f64; 4]) -> Option<ArrowPrimitive> {
    let newtons = force.norm();
    let length = (ARROW.0 * newtons).min(ARROW.1);
    // Shorter ones cannot be seen.
    if length < 1e-3 {
        return None;
    }
    let along = UnitQuaternion::rotation_between(&Vector3::x(), force)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI));
    let at = Isometry3::from_parts(Translation3::from(Vector3::from(from)), along);
    let head = (0.3 * length).min(0.015);
    Some(ArrowPrimitive {
        pose: pose(&at),
        shaft_length: length - head,
        shaft_diameter: 0.004,
        head_length: head,
        head_diameter: 0.01,
        color: color(tint),
    })
}
