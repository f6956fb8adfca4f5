//! A recording as one MCAP file, for Foxglove, Rerun and whatever else reads it.
//!
//! | file | what it holds |
//! |---|---|
//! | `source` | the recording's folder, read back |
//! | `proto` | messages and their descriptors as Protocol Buffers |
//! | `schemas` | the messages |
//! | `models` | bodies, cut out of the animated scene |
//! | `motion` | transforms, joints and forces |
//! | `camera` | what was seen, and what was made of it in the picture |
//! | `scene` | bodies, estimates, plans and contacts in space |
//! | `log` | what was decided, and what failed |
//!
//! All of it is made of the folder alone. Times are simulated ones.

mod camera;
mod log;
mod models;
mod motion;
mod proto;
mod scene;
mod schemas;
mod source;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result};
use mcap::WriteOptions;
use mcap::records::MessageHeader;
use nalgebra::{Isometry3, Point3, Vector3};

use self::models::Models;
use self::proto::Message;
use self::schemas::{Color, Pose, Quaternion, Timestamp};
use self::source::Source;
use super::replay::numbered;

/// The file's name in the folder of a recording.
pub const FILE: &str = "trial.mcap";
/// How an MCAP file begins.
pub const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// The frame in which everything stands.
const WORLD: &str = "world";
/// That of the camera: x right, y down, z forward.
const CAMERA: &str = "camera/optical";

/// The file of a recording, whose folder this is, or which is in the run's folder that this is.
///
/// # Errors
/// When the folder is no recording, is one without poses and pictures, or is damaged.
pub fn bytes(folder: &Path) -> Result<Vec<u8>> {
    let source = Source::read(folder)?;
    let mut out = Out::default();
    tell(&source, &mut out).with_context(|| folder.display().to_string())?;
    let about = &source.about;
    let about = [
        ("schema", about.schema.clone()),
        ("scenario", about.scenario.clone()),
        ("seed", about.seed.to_string()),
        ("scene", about.scene.clone()),
        ("condition", about.condition.clone()),
        ("estimator", about.estimator.clone()),
        ("grasper", about.grasper.clone()),
    ];
    out.finish(about.map(|(key, value)| (key.to_owned(), value)).into()).context("MCAP")
}

/// Says everything.
fn tell(source: &Source, out: &mut Out) -> Result<()> {
    let models = Models::read(&source.replay)?;
    motion::tell(source, out)?;
    camera::tell(source, &models, out)?;
    scene::tell(source, &models, out)?;
    log::tell(source, out)
}

/// Writes that file, whole or not at all.
///
/// # Errors
/// As [`bytes`], or when it cannot be written.
pub fn write(folder: &Path, file: &Path) -> Result<()> {
    Ok(grip_sim::bop::write_atomic(file, &bytes(folder)?)?)
}

/// A topic.
struct Channel {
    topic: &'static str,
    schema: &'static str,
    descriptor: Vec<u8>,
    messages: u32,
}

/// What is said, on which channel, and when: nanoseconds.
struct Said {
    time: u64,
    channel: usize,
    sequence: u32,
    message: Vec<u8>,
}

/// A file that is being made.
#[derive(Default)]
struct Out {
    channels: Vec<Channel>,
    said: Vec<Said>,
}

impl Out {
    /// Says something on a topic at a simulated time, seconds; on each topic in the order of times.
    fn say<M: Message>(&mut self, topic: &'static str, time_s: f64, message: &M) {
        let known = self.channels.iter().position(|channel| channel.topic == topic);
        let channel = known.unwrap_or_else(|| {
            let descriptor = M::descriptor();
            self.channels.push(Channel { topic, schema: M::NAME, descriptor, messages: 0 });
            self.channels.len() - 1
        });
        let sequence = self.channels[channel].messages;
        self.channels[channel].messages += 1;
        self.said.push(Said { time: nanoseconds(time_s), channel, sequence, message: message.encode() });
    }

    fn finish(mut self, about: BTreeMap<String, String>) -> mcap::McapResult<Vec<u8>> {
        self.said.sort_by_key(|said| said.time);
        let mut file = Cursor::new(Vec::new());
        let library = concat!("grip ", env!("CARGO_PKG_VERSION"));
        let mut writer = WriteOptions::new().compression(None).library(library).create(&mut file)?;
        writer.write_metadata(&mcap::records::Metadata { name: "grip".to_owned(), metadata: about })?;
        let mut numbers = Vec::new();
        for channel in &self.channels {
            let schema = writer.add_schema(channel.schema, "protobuf", &channel.descriptor)?;
            numbers.push(writer.add_channel(schema, channel.topic, "protobuf", &BTreeMap::new())?);
        }
        for said in &self.said {
            let header = MessageHeader {
                channel_id: numbers[said.channel],
                sequence: said.sequence,
                log_time: said.time,
                publish_time: said.time,
            };
            writer.write_to_known_channel(&header, &said.message)?;
        }
        writer.finish()?;
        drop(writer);
        Ok(file.into_inner())
    }
}

fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1e9).round() as u64
}

fn timestamp(time_s: f64) -> Timestamp {
    let time = nanoseconds(time_s);
    Timestamp { seconds: (time / 1_000_000_000) as i64, nanos: (time % 1_000_000_000) as i32 }
}

/// The frame of a link: its name, as others know it, but for one that would be taken for the world.
fn link_frame(name: &str) -> String {
    if name == WORLD { format!("link/{name}") } else { name.to_owned() }
}

/// The frame of an object, and its name in the animated scene.
fn object_frame(name: &str, instance: i64) -> String {
    format!("object/{}", numbered(name, instance))
}

fn vector(v: &Vector3<f64>) -> schemas::Vector3 {
    schemas::Vector3 { x: v.x, y: v.y, z: v.z }
}

fn point(p: &Point3<f64>) -> schemas::Point3 {
    schemas::Point3 { x: p.x, y: p.y, z: p.z }
}

fn pose(pose: &Isometry3<f64>) -> Pose {
    let q = &pose.rotation;
    Pose {
        position: vector(&pose.translation.vector),
        orientation: Quaternion { x: q.i, y: q.j, z: q.k, w: q.w },
    }
}

fn color([r, g, b, a]: [f64; 4]) -> Color {
    Color { r, g, b, a }
}

/// Estimates that are acted by, and those that are not.
fn estimate_color(believed: bool, opaque: f64) -> Color {
    let [r, g, b] = if believed { [0.1, 0.75, 0.3] } else { [0.9, 0.4, 0.1] };
    color([r, g, b, opaque])
}
