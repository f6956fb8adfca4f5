//! Intrinsics from ROS: a calibration file (camera_calibration_parsers), or a `sensor_msgs/CameraInfo` as it is printed.
//!
//! Our cameras have no distortion of their own, so pictures are as after rectification: where the file has a distortion, its
//! projection matrix counts, and where it has none, its camera matrix.

use std::path::Path;

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::Intrinsics;
use crate::files;
use crate::{Error, Result};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraInfo {
    #[serde(alias = "image_width")]
    width: usize,
    #[serde(alias = "image_height")]
    height: usize,
    /// Row by row; the short names are those of messages, in ROS 1 and 2.
    #[serde(alias = "K", alias = "k")]
    camera_matrix: Matrix,
    #[serde(default, alias = "D", alias = "d")]
    distortion_coefficients: Matrix,
    #[serde(default, alias = "P", alias = "p")]
    projection_matrix: Matrix,
    #[serde(default)]
    binning_x: u32,
    #[serde(default)]
    binning_y: u32,
    #[serde(default)]
    roi: Roi,
    #[serde(default, rename = "header")]
    _header: IgnoredAny,
    #[serde(default, rename = "camera_name")]
    _camera_name: IgnoredAny,
    #[serde(default, rename = "distortion_model")]
    _distortion_model: IgnoredAny,
    /// How the picture is turned before it is projected, of stereo pairs; the rest of the camera is as without.
    #[serde(default, rename = "rectification_matrix", alias = "R", alias = "r")]
    _rectification_matrix: IgnoredAny,
}

/// A list of numbers, with or without its shape.
#[derive(Deserialize, Default)]
#[serde(from = "ListOrShaped")]
struct Matrix(Vec<f64>);

#[derive(Deserialize)]
#[serde(untagged, expecting = "a list of numbers, or `rows`, `cols` and `data`")]
enum ListOrShaped {
    List(Vec<f64>),
    Shaped {
        data: Vec<f64>,
        #[serde(default, rename = "rows")]
        _rows: IgnoredAny,
        #[serde(default, rename = "cols")]
        _cols: IgnoredAny,
    },
}

impl From<ListOrShaped> for Matrix {
    fn from(either: ListOrShaped) -> Self {
        match either {
            ListOrShaped::List(data) | ListOrShaped::Shaped { data, .. } => Self(data),
        }
    }
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Roi {
    x_offset: usize,
    y_offset: usize,
    width: usize,
    height: usize,
}

impl Intrinsics {
    /// Of a ROS calibration file or a printed `CameraInfo`, YAML.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read; [`Error::Invalid`] naming field and value: a part of a picture, a skewed camera,
    /// a distortion without a projection matrix.
    pub fn load_ros(path: &Path) -> Result<Self> {
        let text = files::read_to_string(path)?;
        let (intrinsics, rectified) = parse(&text).map_err(|message| Error::invalid(path, message))?;
        if rectified {
            log::warn!("{}: pictures are as after rectification, without its distortion", path.display());
        }
        Ok(intrinsics)
    }
}

/// The camera, and whether it is the rectified one.
fn parse(text: &str) -> std::result::Result<(Intrinsics, bool), String> {
    let info: CameraInfo =
        serde_saphyr::from_str(text).map_err(|error| format!("is no ROS camera calibration: {error}"))?;
    let Roi { x_offset, y_offset, width, height } = info.roi;
    if [x_offset, y_offset] != [0, 0] || ![[0, 0], [info.width, info.height]].contains(&[width, height]) {
        return Err(format!(
            "roi: {width}x{height} at {x_offset}, {y_offset}: only whole pictures are supported"
        ));
    }
    if info.binning_x > 1 || info.binning_y > 1 {
        return Err(format!(
            "binning {}x{}: not supported; give the calibration of the binned picture",
            info.binning_x, info.binning_y
        ));
    }
    let distorted = info.distortion_coefficients.0.iter().any(|value| *value != 0.0);
    let (name, columns, matrix) = if distorted {
        ("projection_matrix (P)", 4, &info.projection_matrix.0)
    } else {
        ("camera_matrix (K)", 3, &info.camera_matrix.0)
    };
    let [fx, skew, cx, below, fy, cy] = match matrix.as_slice() {
        m if m.len() == 3 * columns => [m[0], m[1], m[2], m[columns], m[columns + 1], m[columns + 2]],
        [] => {
            return Err(format!(
                "{name} is missing; a camera with distortion is simulated as after rectification"
            ));
        }
        m => return Err(format!("{name} has {} numbers, not {}", m.len(), 3 * columns)),
    };
    if skew != 0.0 || below != 0.0 {
        return Err(format!("{name} = {matrix:?}: skewed cameras are not supported"));
    }
    let intrinsics = Intrinsics { width: info.width, height: info.height, fx, fy, cx, cy };
    intrinsics.problem().map_or(Ok((intrinsics, distorted)), |problem| Err(format!("{name}: {problem}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [554.5, 0, 320.25, 0., 553.5, 240, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  \
        cols: 5\n  data: [0, 0, 0, 0, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n\
        projection_matrix:\n  rows: 3\n  cols: 4\n  data: [500.5, 0, 321, 0, 0, 501, 241, 0, 0, 0, 1, 0]\n";
    const MESSAGE: &str = "header:\n  seq: 3\n  stamp: {secs: 1, nsecs: 2}\n  frame_id: \"camera\"\nheight: 480\nwidth: 640\n\
        distortion_model: \"plumb_bob\"\nD: [0.1, -0.2, 0.001, 0.0, 0.0]\nK: [554.5, 0.0, 320.25, 0.0, 553.5, 240.0, 0.0, 0.0, 1.0]\n\
        R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n\
        P: [500.5, 0.0, 321.0, 0.0, 0.0, 501.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]\nbinning_x: 0\nbinning_y: 0\n\
        roi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n";

    #[test]
    fn the_camera_matrix_counts_without_distortion_and_the_projection_with_it() {
        let plain = Intrinsics { width: 640, height: 480, fx: 554.5, fy: 553.5, cx: 320.25, cy: 240.0 };
        let rectified = Intrinsics { fx: 500.5, fy: 501.0, cx: 321.0, cy: 241.0, ..plain };
        assert_eq!(parse(FILE), Ok((plain, false)));
        assert_eq!(parse(MESSAGE), Ok((rectified, true)));
        // As ROS 2 prints it.
        let lower = MESSAGE
            .replace("\nD:", "\nd:")
            .replace("\nK:", "\nk:")
            .replace("\nR:", "\nr:")
            .replace("\nP:", "\np:");
        assert_eq!(parse(&lower), Ok((rectified, true)));
    }

    #[test]
    fn what_is_not_supported_is_named() {
        for (from, to, wanted) in [
            (
                "P: [500.5, 0.0, 321.0, 0.0, 0.0, 501.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]\n",
                "",
                "projection_matrix (P) is missing",
            ),
            ("P: [500.5,", "P: [", "has 11 numbers, not 12"),
            ("binning_x: 0", "binning_x: 2", "binning 2x0"),
            ("x_offset: 0", "x_offset: 8", "roi: 0x0 at 8, 0"),
            ("P: [500.5, 0.0", "P: [500.5, 0.5", "skewed"),
            ("P: [500.5", "P: [0.0", "fx 0"),
            ("width: 640\n", "", "width"),
            ("D: [0.1", "Q: [0.1", "Q"),
            ("height: 480", "height: tall", "tall"),
        ] {
            let error = parse(&MESSAGE.replacen(from, to, 1)).unwrap_err();
            assert!(error.contains(wanted), "{wanted}: {error}");
        }
    }
}
