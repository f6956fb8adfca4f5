//! Intrinsics from files and command lines.

use std::path::Path;
use std::str::FromStr;

use super::Intrinsics;
use crate::bop::CameraFile;
use crate::files;
use crate::{Error, Result};

/// What is understood, for messages.
const FORMS: &str =
    "give FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's camera.json";

impl Intrinsics {
    /// Whether a text is the name of a file that [`Intrinsics::load`] may read.
    pub fn is_file(text: &str) -> bool {
        [".yaml", ".yml", ".json"].iter().any(|ending| text.ends_with(ending))
    }

    /// Reads a ROS calibration (`.yaml`, [`Intrinsics::load_ros`]) or BOP's `camera.json`.
    ///
    /// # Errors
    /// When it is neither, or a number is out of range.
    pub fn load(path: &Path) -> Result<Self> {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let invalid = |message: String| Error::invalid(path, message);
        match ending {
            "yaml" | "yml" => Self::load_ros(path),
            "json" => {
                let text = files::read_to_string(path)?;
                let file: CameraFile = serde_json::from_str(&text)
                    .map_err(|error| invalid(format!("is no camera.json of BOP: {error}")))?;
                let CameraFile { width, height, fx, fy, cx, cy, .. } = file;
                let intrinsics = Self { width, height, fx, fy, cx, cy };
                intrinsics.problem().map_or(Ok(intrinsics), |problem| Err(invalid(problem)))
            }
            _ => Err(invalid(format!("is no file of intrinsics; {FORMS}"))),
        }
    }
}

/// `FX,FY,CX,CY,WIDTH,HEIGHT`, or the path of a file.
impl FromStr for Intrinsics {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if Self::is_file(text) {
            return Self::load(Path::new(text)).map_err(|error| error.to_string());
        }
        let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        let Some([fx, fy, cx, cy, width, height]) = numbers.as_deref() else {
            return Err(FORMS.to_owned());
        };
        let whole = |side: f64| (side.fract() == 0.0 && (0.0..1e6).contains(&side)).then_some(side as usize);
        let (Some(width), Some(height)) = (whole(*width), whole(*height)) else {
            return Err(format!(
                "{width} x {height}: width and height must be whole numbers of pixels; {FORMS}"
            ));
        };
        let intrinsics = Self { width, height, fx: *fx, fy: *fy, cx: *cx, cy: *cy };
        intrinsics.problem().map_or(Ok(intrinsics), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_files_say_the_same() {
        let wanted = Intrinsics { width: 1920, height: 1080, fx: 1066.8, fy: 1067.5, cx: 312.9, cy: 241.3 };
        assert_eq!("1066.8, 1067.5,312.9,241.3,1920,1080".parse(), Ok(wanted));
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path.to_str().unwrap().parse::<Intrinsics>()
        };
        let bop = r#"{"cx": 312.9, "cy": 241.3, "depth_scale": 0.1, "fx": 1066.8, "fy": 1067.5, "height": 1080, "width": 1920}"#;
        assert_eq!(read("camera.json", bop), Ok(wanted));
        let ros = "{image_width: 1920, image_height: 1080, camera_matrix: {rows: 3, cols: 3, data: [1066.8, 0, 312.9, 0, 1067.5, 241.3, 0, 0, 1]}}";
        assert_eq!(read("camera.yaml", ros), Ok(wanted));
        let error = |text: &str| text.parse::<Intrinsics>().unwrap_err();
        assert!(error("600,600,320,240,640").contains("FX,FY,CX,CY,WIDTH,HEIGHT"));
        assert!(error("600,600,320,240,640.5,480").contains("640.5 x 480: width and height"));
        assert!(error("0,600,320,240,640,480").contains("fx 0"));
        assert!(error("/nowhere/camera.json").contains("/nowhere/camera.json"));
        assert!(read("other.json", "{}").unwrap_err().contains("is no camera.json of BOP"));
    }
}
