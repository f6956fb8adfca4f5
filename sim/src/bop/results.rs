//! Pose estimates in the format of the BOP challenge: a CSV file, one estimate a line.
//!
//! `scene_id,im_id,obj_id,score,R,t,time`: `R` nine numbers row by row, `t` three in millimetres, both object to camera and
//! separated by spaces; `time` the seconds spent on the whole image, -1 where unknown.

use std::path::Path;

use super::format::{in_metres, isometry, matrix};
use crate::files;
use crate::pose::{Camera, Object, Pose};
use crate::{Error, Result};

/// One line of a results file.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Scene.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// Object.
    pub obj_id: u32,
    /// Confidence, larger is surer; comparable within one file.
    pub score: f64,
    /// The pose.
    pub camera_from_object: Pose<Camera, Object>,
    /// Seconds spent on the whole image.
    pub time_s: Option<f64>,
}

/// The columns.
pub const HEADER: &str = "scene_id,im_id,obj_id,score,R,t,time";

impl Estimate {
    /// The line, with its end.
    pub fn line(&self) -> String {
        let (r, t) = matrix(self.camera_from_object.iso());
        let join = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let Self { scene_id, im_id, obj_id, score, .. } = self;
        let time = self.time_s.unwrap_or(-1.0);
        format!("{scene_id},{im_id},{obj_id},{score},{},{},{time}\n", join(&r), join(&t))
    }

    fn parse(record: &csv::StringRecord) -> std::result::Result<Self, String> {
        let number = |i: usize, name: &str| -> std::result::Result<u32, String> {
            record[i].trim().parse().map_err(|_| format!("{name} = {:?}: must be a whole number", &record[i]))
        };
        let score: f64 =
            float(&record[3]).ok_or_else(|| format!("score = {:?}: must be a number", &record[3]))?;
        let r: [f64; 9] =
            floats(&record[4]).ok_or_else(|| format!("R = {:?}: must be nine numbers", &record[4]))?;
        let t: [f64; 3] = floats(&record[5])
            .ok_or_else(|| format!("t = {:?}: must be three numbers, millimetres", &record[5]))?;
        let time = float(&record[6])
            .ok_or_else(|| format!("time = {:?}: must be seconds, or -1 where unknown", &record[6]))?;
        Ok(Self {
            scene_id: number(0, "scene_id")?,
            im_id: number(1, "im_id")?,
            obj_id: number(2, "obj_id")?,
            score,
            camera_from_object: Pose::new(isometry(&r, &t).map_err(|reason| format!("R = {reason}"))?),
            time_s: (time >= 0.0).then_some(time),
        })
    }
}

fn float(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

fn floats<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> = text.split_whitespace().map(float).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

/// Reads a results file. The header may be missing; lines that begin with `#` are skipped.
///
/// # Errors
/// [`Error::Io`], or [`Error::Invalid`] with line, field and value.
pub fn read_results(path: &Path) -> Result<Vec<Estimate>> {
    let text = files::read_to_string(path)?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let mut estimates = Vec::new();
    for (index, record) in reader.records().enumerate() {
        let record = record.map_err(|error| Error::invalid(path, error.to_string()))?;
        if index == 0
            && record
                .iter()
                .map(|field| field.trim().to_ascii_lowercase())
                .eq(HEADER.to_ascii_lowercase().split(','))
        {
            continue;
        }
        let line = record.position().map_or(0, csv::Position::line);
        let invalid = |message: String| Error::invalid(path, format!("line {line}: {message}"));
        if record.iter().all(|field| field.trim().is_empty()) {
            continue;
        }
        if index == 0 && record.get(0).is_some_and(|field| field.trim().eq_ignore_ascii_case("scene_id")) {
            return Err(invalid(format!("the header is not `{HEADER}`; fields have this order")));
        }
        if record.len() == 1 && record.iter().any(|field| field.contains([';', '\t'])) {
            return Err(invalid(format!("fields are separated by commas, as in `{HEADER}`")));
        }
        if record.len() != 7 {
            return Err(invalid(format!("has {} fields and not the seven of `{HEADER}`", record.len())));
        }
        estimates.push(Estimate::parse(&record).map_err(invalid)?);
    }
    let places = estimates.iter().map(|estimate| estimate.camera_from_object.translation());
    match in_metres("t", places) {
        Some(message) => Err(Error::invalid(path, message)),
        None => Ok(estimates),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(im_id: u32) -> Estimate {
        Estimate {
            scene_id: 1,
            im_id,
            obj_id: 5,
            score: 0.75,
            camera_from_object: Pose::from_xyz_rpy([0.01, -0.02, 0.9], [0.3, -0.2, 2.0]),
            time_s: (im_id == 0).then_some(0.125),
        }
    }

    #[test]
    fn estimates_survive_the_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let all = [estimate(0), estimate(1)];
        for header in [format!("{HEADER}\n"), String::new(), "# made by hand\n".to_owned()] {
            std::fs::write(&path, header + &all[0].line() + &all[1].line()).unwrap();
            let back = read_results(&path).unwrap();
            assert_eq!(back.len(), 2);
            for (a, b) in back.iter().zip(&all) {
                let off = a.camera_from_object.inverse() * b.camera_from_object;
                assert!(off.translation().norm() < 1e-12 && off.rotation().angle() < 1e-7);
                assert_eq!(
                    (a.scene_id, a.im_id, a.obj_id, a.score, a.time_s),
                    (1, b.im_id, 5, 0.75, b.time_s)
                );
            }
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let good = estimate(0).line();
        for (bad, expected) in [
            ("1,2,3\n", "line 2: has 3 fields"),
            ("x,0,5,0.5,1 0 0 0 1 0 0 0 1,0 0 1,-1\n", "scene_id = \"x\""),
            ("1,0,5,nan,1 0 0 0 1 0 0 0 1,0 0 1,-1\n", "score = \"nan\""),
            ("1,0,5,0.5,1 0 0 0 1 0 0 0,0 0 1,-1\n", "R = \"1 0 0 0 1 0 0 0\": must be nine"),
            ("1,0,5,0.5,2 0 0 0 1 0 0 0 1,0 0 1,-1\n", "is not a rotation"),
            ("1,0,5,0.5,1 0 0 0 1 0 0 0 1,0 0 inf,-1\n", "t = \"0 0 inf\""),
            ("1,0,5,0.5,1 0 0 0 1 0 0 0 1,0 0 1,soon\n", "time = \"soon\""),
        ] {
            std::fs::write(&path, good.clone() + bad).unwrap();
            let error = read_results(&path).unwrap_err().to_string();
            assert!(error.contains("line 2") && error.contains(expected), "{error}");
        }
        assert!(read_results(&folder.path().join("none.csv")).unwrap_err().to_string().contains("none.csv"));
    }
}
