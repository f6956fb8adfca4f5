//! A recording's folder, read back.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use image::DynamicImage;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::record::save::{RecordFile, SCHEMA};
use crate::table::{self, Column};

/// A table, its columns by name.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    columns: HashMap<String, Column>,
    /// How many rows it has.
    pub rows: usize,
}

/// The columns of one kind.
macro_rules! columns {
    ($($name:ident: $column:ident of $type:ty, $kind:literal;)+) => {$(
        pub fn $name(&self, name: &str) -> Result<&[$type]> {
            match self.columns.get(name) {
                Some(Column::$column(values)) => Ok(values),
                _ => bail!(
                    "{}: has no column {name} of {}; the recording is damaged or of another version: record it again",
                    self.path.display(),
                    $kind
                ),
            }
        }
    )+};
}

impl Table {
    fn read(folder: &Path, name: &str) -> Result<Self> {
        let path = folder.join(format!("{name}.parquet"));
        let columns = table::read(&path).context("the recording is damaged: record it again")?;
        let rows = columns.first().map_or(0, |(_, column)| column.len());
        Ok(Self { path, rows, columns: columns.into_iter().collect() })
    }

    columns! {
        text: Text of String, "text";
        whole: Whole of i64, "whole numbers";
        yes: Yes of bool, "yes and no";
        numbers: Number of Option<f64>, "numbers";
        single: Single of f32, "numbers of single precision";
    }

    /// Simulated times of rows, seconds.
    pub fn seconds(&self, name: &str) -> Result<Vec<f64>> {
        let values = self.numbers(name)?.iter().enumerate();
        let second = |(row, value): (usize, &Option<f64>)| {
            let good = value.filter(|seconds| (0.0..1e9).contains(seconds));
            good.with_context(|| format!("{}: row {row}: {name} is no time: {value:?}", self.path.display()))
        };
        values.map(second).collect()
    }

    /// Poses of rows, where they have any.
    pub fn places(&self, name: &str) -> Result<Vec<Option<Isometry3<f64>>>> {
        let part = |part: &str| self.numbers(&format!("{name}_{part}"));
        let [x, y, z] = [part("x")?, part("y")?, part("z")?];
        let [i, j, k, w] = [part("qx")?, part("qy")?, part("qz")?, part("qw")?];
        let place = |n: usize| Some(pose([x[n]?, y[n]?, z[n]?], [i[n]?, j[n]?, k[n]?, w[n]?]));
        Ok((0..self.rows).map(place).collect())
    }

    /// Three numbers of rows.
    pub fn vectors(&self, name: &str) -> Result<Vec<[f64; 3]>> {
        let part = |part: &str| self.single(&format!("{name}_{part}"));
        let [x, y, z] = [part("x")?, part("y")?, part("z")?];
        Ok((0..self.rows).map(|n| [x[n], y[n], z[n]].map(f64::from)).collect())
    }

    /// Four numbers of rows.
    fn quaternions(&self, name: &str) -> Result<Vec<[f64; 4]>> {
        let w = self.single(&format!("{name}_w"))?;
        let vectors = self.vectors(name)?;
        Ok(vectors.into_iter().zip(w).map(|([x, y, z], w)| [x, y, z, f64::from(*w)]).collect())
    }
}

fn pose([x, y, z]: [f64; 3], [i, j, k, w]: [f64; 4]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

/// A body, by what is written of it: `link` or `object`, name, which of several.
pub type Body = (String, String, i64);

/// Where bodies are that have moved since the moment before.
#[derive(Debug)]
pub struct Moment {
    /// Seconds.
    pub time_s: f64,
    /// World from body.
    pub moved: Vec<(Body, Isometry3<f64>)>,
}

/// A look.
#[derive(Debug)]
pub struct Look {
    /// Its number.
    pub look: i64,
    /// Seconds.
    pub time_s: f64,
    /// World from camera.
    pub camera: Isometry3<f64>,
    /// What is done next.
    pub decision: String,
    /// The file of the colour image.
    pub png: Vec<u8>,
    /// Colours by pixel,
    pub rgb: image::RgbImage,
    /// and millimetres; 0 is no reading.
    pub depth: Vec<u16>,
}

/// An object as it was estimated at a look.
#[derive(Debug)]
pub struct Estimate {
    /// Number of the look.
    pub look: i64,
    /// The object.
    pub object: String,
    /// Which of several.
    pub instance: i64,
    /// 0 to 1.
    pub confidence: f64,
    /// Whether that is enough to act by.
    pub believed: bool,
    /// World from object.
    pub pose: Isometry3<f64>,
}

/// A recording.
#[derive(Debug)]
pub struct Source {
    /// record.json.
    pub about: RecordFile,
    /// Looks.
    pub looks: Vec<Look>,
    /// Estimates.
    pub estimates: Vec<Estimate>,
    /// Poses, moment by moment.
    pub moments: Vec<Moment>,
    /// The tables that are used as they are.
    pub plans: Table,
    /// One an attempt.
    pub attempts: Table,
    /// Where things came to rest.
    pub rests: Table,
    /// Planned motions.
    pub planned: Table,
    /// Joints and forces.
    pub samples: Table,
    /// Contacts.
    pub contacts: Table,
    /// The animated scene.
    pub replay: Vec<u8>,
}

impl Source {
    /// Reads the folder of a recording, or the one in a run's folder.
    ///
    /// # Errors
    /// When it is none, has no poses and pictures, or is damaged.
    pub fn read(given: &Path) -> Result<Self> {
        let folder = &folder_of(given)?;
        let about = about(&folder.join("record.json"))?;
        let table = |name: &str| Table::read(folder, name);
        Ok(Self {
            looks: looks(folder, &table("looks")?, &about)?,
            estimates: estimates(&table("estimates")?)?,
            moments: moments(&table("poses")?)?,
            plans: table("plans")?,
            attempts: table("attempts")?,
            rests: table("rests")?,
            planned: table("trajectories")?,
            samples: table("samples")?,
            contacts: table("contacts")?,
            replay: read(&folder.join(crate::record::save::REPLAY))?,
            about,
        })
    }
}

/// The folder with the recording.
///
/// # Errors
/// When there is none.
pub fn folder_of(given: &Path) -> Result<PathBuf> {
    let places = [given.to_owned(), given.join("record")];
    let found = places.into_iter().find(|folder| folder.join("record.json").is_file());
    found.with_context(|| {
        format!(
            "{}: is no recording: neither it nor its folder record/ has a record.json; give what `grip pack --record full` has made",
            given.display()
        )
    })
}

fn about(path: &Path) -> Result<RecordFile> {
    let bytes = read(path)?;
    let value: serde_json::Value =
        serde_json::from_slice(&bytes).with_context(|| format!("{}: is no JSON", path.display()))?;
    ensure!(
        value["schema"] == SCHEMA,
        "{}: field schema is {}, not \"{SCHEMA}\"; record it again by this version of the program",
        path.display(),
        value["schema"]
    );
    let about: RecordFile =
        serde_json::from_value(value).with_context(|| format!("{}: is damaged", path.display()))?;
    ensure!(
        about.level == "full",
        "{}: was recorded at level {}, which keeps neither poses nor pictures; record it with --record full",
        path.display(),
        about.level
    );
    Ok(about)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| {
        format!("{}: cannot be read; the recording is damaged: record it again", path.display())
    })
}

fn looks(folder: &Path, table: &Table, about: &RecordFile) -> Result<Vec<Look>> {
    let (times, cameras) = (table.seconds("time_s")?, table.places("camera")?);
    let (numbers, decisions) = (table.whole("look")?, table.text("decision")?);
    let size = (about.intrinsics.width as u32, about.intrinsics.height as u32);
    let mut looks = Vec::new();
    for (n, &look) in numbers.iter().enumerate() {
        let path = |kind: &str| folder.join(format!("looks/{look:02}_{kind}.png"));
        let picture = |kind: &str| -> Result<(Vec<u8>, DynamicImage)> {
            let (path, bytes) = (path(kind), read(&path(kind))?);
            let picture = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png)
                .with_context(|| format!("{}: cannot be read as a picture", path.display()))?;
            let found = (picture.width(), picture.height());
            ensure!(
                found == size,
                "{}: has {found:?} pixels, and the camera {size:?}; record it again",
                path.display()
            );
            Ok((bytes, picture))
        };
        let (png, rgb) = picture("rgb")?;
        let DynamicImage::ImageLuma16(depth) = picture("depth")?.1 else {
            bail!("{}: is not grey of 16 bits; record it again", path("depth").display());
        };
        looks.push(Look {
            look,
            time_s: times[n],
            camera: cameras[n].with_context(|| format!("{}: row {n}: no camera", table.path.display()))?,
            decision: decisions[n].clone(),
            png,
            rgb: rgb.into_rgb8(),
            depth: depth.into_raw(),
        });
    }
    Ok(looks)
}

fn estimates(table: &Table) -> Result<Vec<Estimate>> {
    let (looks, poses) = (table.whole("look")?, table.places("estimate")?);
    let (objects, instances) = (table.text("object")?, table.whole("instance")?);
    let (confidences, believed) = (table.numbers("confidence")?, table.yes("believed")?);
    let estimate = |n: usize| {
        let confidence = confidences[n].unwrap_or(0.0);
        Some(Estimate {
            look: looks[n],
            object: objects[n].clone(),
            instance: instances[n],
            confidence,
            believed: believed[n],
            pose: poses[n]?,
        })
    };
    Ok((0..table.rows).filter_map(estimate).collect())
}

fn moments(table: &Table) -> Result<Vec<Moment>> {
    let times = table.seconds("time_s")?;
    let (kinds, names, instances) = (table.text("kind")?, table.text("name")?, table.whole("instance")?);
    let (positions, rotations) = (table.vectors("position")?, table.quaternions("rotation")?);
    let mut moments: Vec<Moment> = Vec::new();
    for (n, &time_s) in times.iter().enumerate() {
        let last = moments.last().map(|moment| moment.time_s);
        ensure!(
            last.is_none_or(|last| last <= time_s),
            "{}: row {n}: time runs backwards; the recording is damaged: record it again",
            table.path.display()
        );
        if last != Some(time_s) {
            moments.push(Moment { time_s, moved: Vec::new() });
        }
        let body = (kinds[n].clone(), names[n].clone(), instances[n]);
        if let Some(moment) = moments.last_mut() {
            moment.moved.push((body, pose(positions[n], rotations[n])));
        }
    }
    ensure!(
        !moments.is_empty(),
        "{}: is empty; the recording is damaged: record it again",
        table.path.display()
    );
    Ok(moments)
}
