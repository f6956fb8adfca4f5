//! The JSON files of a data set, as they are: millimetres, row-major matrices. Fields that we do not know are let pass,
//! since every data set adds its own.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3, Vector4};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use crate::files;
use crate::{Error, Result};

/// Metres in a millimetre.
pub(super) const MILLIMETRE: f64 = 1e-3;
/// No object that a robot's camera sees is smaller.
const SMALLEST_MM: f64 = 2.0;
/// Entries of `R Rᵀ` may depart from the identity by this much: files give as few as four digits.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// `camera.json`: the sensor, for simulation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CameraFile {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length along u, pixels.
    pub fx: f64,
    /// Focal length along v, pixels.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Millimetres in a unit of the depth pictures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_scale: Option<f64>,
}

/// One image of `scene_camera.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CameraEntry {
    /// Intrinsic matrix, row by row.
    #[serde(rename = "cam_K", deserialize_with = "numbers")]
    pub k: [f64; 9],
    /// Millimetres in a unit of the depth picture.
    pub depth_scale: f64,
    /// Rotation from world to camera, row by row.
    #[serde(
        rename = "cam_R_w2c",
        default,
        deserialize_with = "optional_numbers",
        skip_serializing_if = "Option::is_none"
    )]
    pub r_w2c: Option<[f64; 9]>,
    /// Translation from world to camera, millimetres.
    #[serde(
        rename = "cam_t_w2c",
        default,
        deserialize_with = "optional_numbers",
        skip_serializing_if = "Option::is_none"
    )]
    pub t_w2c: Option<[f64; 3]>,
}

/// One instance in an image of `scene_gt.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GtEntry {
    /// Rotation from model to camera, row by row.
    #[serde(rename = "cam_R_m2c", deserialize_with = "numbers")]
    pub r_m2c: [f64; 9],
    /// Translation from model to camera, millimetres.
    #[serde(rename = "cam_t_m2c", deserialize_with = "numbers")]
    pub t_m2c: [f64; 3],
    /// The object.
    pub obj_id: u32,
}

/// One instance in an image of `scene_gt_info.json`; see [`gt_info`](super::gt_info()) for how it is measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GtInfo {
    /// Box of the whole silhouette, also outside of the image: x, y, then largest less smallest column and row. All -1
    /// where nothing is visible.
    pub bbox_obj: [i32; 4],
    /// The same of the visible part.
    pub bbox_visib: [i32; 4],
    /// Pixels in the whole silhouette, also outside of the image.
    pub px_count_all: u64,
    /// Pixels of the silhouette in the image that have a depth reading.
    pub px_count_valid: u64,
    /// Visible pixels.
    pub px_count_visib: u64,
    /// `px_count_visib / px_count_all`; 0 for an empty silhouette.
    pub visib_fract: f64,
}

/// An instance is asked for when at least this share of its silhouette is visible, as in the challenge.
pub const TARGET_VISIBLE: f64 = 0.1;

impl GtInfo {
    /// Whether enough is seen of the instance to ask for it.
    pub fn is_target(&self) -> bool {
        self.visib_fract >= TARGET_VISIBLE
    }
}

/// One entry of `test_targets_bop19.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Target {
    /// Scene.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// Object that is looked for.
    pub obj_id: u32,
    /// How many of it there are.
    pub inst_count: u32,
}

/// One entry of `test_targets_bop24.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct TargetImage {
    /// Scene.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
}

/// `scene_camera.json`, by image.
pub type SceneCamera = BTreeMap<u32, CameraEntry>;
/// `scene_gt.json`, by image; the position in the list is the ground-truth index.
pub type SceneGt = BTreeMap<u32, Vec<GtEntry>>;
/// `scene_gt_info.json`, in the order of `scene_gt.json`.
pub type SceneGtInfo = BTreeMap<u32, Vec<GtInfo>>;
/// `models_info.json`, by object.
pub type ModelsFile = BTreeMap<u32, ModelFile>;

/// One object of `models_info.json`, millimetres.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[expect(missing_docs, reason = "the file's own names; see `ModelInfo` for their meaning")]
pub struct ModelFile {
    pub diameter: f64,
    pub min_x: f64,
    pub min_y: f64,
    pub min_z: f64,
    pub size_x: f64,
    pub size_y: f64,
    pub size_z: f64,
    #[serde(default, deserialize_with = "matrices", skip_serializing_if = "Vec::is_empty")]
    pub symmetries_discrete: Vec<[f64; 16]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub symmetries_continuous: Vec<AxisFile>,
}

/// An axis of revolution in `models_info.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AxisFile {
    /// Direction, of any length.
    #[serde(deserialize_with = "numbers")]
    pub axis: [f64; 3],
    /// A point on the axis, millimetres.
    #[serde(deserialize_with = "numbers")]
    pub offset: [f64; 3],
}

/// Size and symmetries of a model, metres, object frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelInfo {
    /// Largest distance between two vertices.
    pub diameter: f64,
    /// Lower corner of the bounding box.
    pub min: Point3<f64>,
    /// Extents of the bounding box.
    pub size: Vector3<f64>,
    /// Turns that carry the model onto itself.
    pub symmetries: Symmetries,
}

/// Turns that carry a model onto itself, metres, object frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Symmetries {
    /// Single turns; the identity is not among them.
    pub discrete: Vec<Isometry3<f64>>,
    /// Axes about which every turn is one.
    pub continuous: Vec<SymmetryAxis>,
}

/// An axis of revolution, object frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SymmetryAxis {
    /// Direction.
    pub axis: Unit<Vector3<f64>>,
    /// A point on it, metres.
    pub through: Point3<f64>,
}

impl Symmetries {
    /// All symmetries as a list, with the identity. Revolutions become steps that move no point by more than `share` of
    /// the diameter, `ceil(pi / share)` of them (BOP: 0.01, so 315); each is combined with each discrete one.
    pub fn transforms(&self, share: f64) -> Vec<Isometry3<f64>> {
        // A share of more than 1 asks for fewer turns than half a circle has; of 0 or less, for endlessly many.
        let steps = (std::f64::consts::PI / share.clamp(1e-4, 1.0)).ceil() as u32;
        let turns: Vec<Isometry3<f64>> = self
            .continuous
            .iter()
            .flat_map(|SymmetryAxis { axis, through }| {
                (0..steps).map(move |step| {
                    let angle = f64::from(step) / f64::from(steps) * std::f64::consts::TAU;
                    let rotation = UnitQuaternion::from_axis_angle(axis, angle);
                    Isometry3::rotation_wrt_point(rotation, *through)
                })
            })
            .collect();
        let single = std::iter::once(Isometry3::identity()).chain(self.discrete.iter().copied());
        if turns.is_empty() {
            return single.collect();
        }
        single.flat_map(|single| turns.iter().map(move |turn| turn * single)).collect()
    }
}

impl ModelFile {
    /// In metres.
    ///
    /// # Errors
    /// Field, value and reason, when a size is not positive or a symmetry is no rigid transform.
    pub fn checked(&self) -> std::result::Result<ModelInfo, String> {
        let size = Vector3::new(self.size_x, self.size_y, self.size_z);
        for (field, value) in
            [("diameter", self.diameter), ("size_x", size.x), ("size_y", size.y), ("size_z", size.z)]
        {
            if value < 0.0 || (field == "diameter" && value == 0.0) {
                return Err(format!("{field} = {value}: must be positive"));
            }
        }
        if self.diameter < SMALLEST_MM {
            return Err(format!(
                "diameter = {}: is less than {SMALLEST_MM} mm; sizes are in millimetres, these seem to be metres",
                self.diameter
            ));
        }
        let discrete = self.symmetries_discrete.iter().enumerate().map(|(index, m)| {
            let [a, b, c, x, d, e, f, y, g, h, i, z, last @ ..] = *m;
            let field = format!("symmetries_discrete[{index}]");
            if Vector4::from(last) != Vector4::w() {
                return Err(format!("{field} = {m:?}: the last row must be 0, 0, 0, 1; it is row-major"));
            }
            isometry(&[a, b, c, d, e, f, g, h, i], &[x, y, z]).map_err(|reason| format!("{field}: {reason}"))
        });
        let continuous = self.symmetries_continuous.iter().enumerate().map(|(index, entry)| {
            let axis = Unit::try_new(Vector3::from(entry.axis), 1e-9).ok_or_else(|| {
                format!("symmetries_continuous[{index}].axis = {:?}: has no direction", entry.axis)
            })?;
            Ok(SymmetryAxis { axis, through: Point3::from(entry.offset) * MILLIMETRE })
        });
        Ok(ModelInfo {
            diameter: self.diameter * MILLIMETRE,
            min: Point3::new(self.min_x, self.min_y, self.min_z) * MILLIMETRE,
            size: size * MILLIMETRE,
            symmetries: Symmetries {
                discrete: discrete.collect::<std::result::Result<_, String>>()?,
                continuous: continuous.collect::<std::result::Result<_, String>>()?,
            },
        })
    }
}

impl From<&ModelInfo> for ModelFile {
    fn from(info: &ModelInfo) -> Self {
        let (min, size) = (info.min / MILLIMETRE, info.size / MILLIMETRE);
        let discrete = info.symmetries.discrete.iter().map(|iso| {
            let ([a, b, c, d, e, f, g, h, i], [x, y, z]) = matrix(iso);
            [a, b, c, x, d, e, f, y, g, h, i, z, 0.0, 0.0, 0.0, 1.0]
        });
        let continuous = info.symmetries.continuous.iter().map(|axis| AxisFile {
            axis: axis.axis.into_inner().into(),
            offset: (axis.through / MILLIMETRE).coords.into(),
        });
        Self {
            diameter: info.diameter / MILLIMETRE,
            min_x: min.x,
            min_y: min.y,
            min_z: min.z,
            size_x: size.x,
            size_y: size.y,
            size_z: size.z,
            symmetries_discrete: discrete.collect(),
            symmetries_continuous: continuous.collect(),
        }
    }
}

/// The rigid transform of a row-major rotation and a translation in millimetres; in metres.
pub(super) fn isometry(r: &[f64; 9], t_mm: &[f64; 3]) -> std::result::Result<Isometry3<f64>, String> {
    let m = Matrix3::from_row_slice(r);
    let off = (m * m.transpose() - Matrix3::identity()).abs().max();
    // Written so that NaN fails.
    if !(off <= ROTATION_TOLERANCE && m.determinant() > 0.0) {
        return Err(format!(
            "{r:?} is not a rotation (R times its transpose is off the identity by {off:.2e}, determinant {:.3}); \
             give a rotation matrix row by row",
            m.determinant()
        ));
    }
    // The nearest rotation: what rounding took away must not come back as a stretch.
    let svd = m.svd(true, true);
    let m = svd.u.zip(svd.v_t).map_or(m, |(u, v_t)| u * v_t);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    Ok(Isometry3::from_parts(Translation3::from(Vector3::from(*t_mm) * MILLIMETRE), rotation))
}

/// The rigid transform of a row-major rotation and a translation in metres.
///
/// # Errors
/// When the nine numbers are no rotation, in words.
pub fn rigid(r: &[f64; 9], t: &[f64; 3]) -> std::result::Result<Isometry3<f64>, String> {
    isometry(r, &t.map(|x| x / MILLIMETRE))
}

/// What is wrong where all objects are nearer to the camera than any camera sees: `places` are metres in the frame of the camera, as
/// read from millimetres.
pub(super) fn in_metres(field: &str, places: impl Iterator<Item = Vector3<f64>>) -> Option<String> {
    const NEAREST_M: f64 = 0.02;
    // What was not found is at the origin in some files.
    let farthest = places.map(|place| place.norm()).fold(0.0, f64::max);
    (farthest > 0.0 && farthest < NEAREST_M).then(|| {
        format!(
            "the farthest object is {:.3} mm from the camera: translations ({field}) are in millimetres; these seem to be metres",
            farthest / MILLIMETRE
        )
    })
}

/// Row-major rotation and translation in millimetres.
pub(super) fn matrix(iso: &Isometry3<f64>) -> ([f64; 9], [f64; 3]) {
    let m = iso.rotation.to_rotation_matrix();
    // Adding zero turns -0.0 into 0.0, which reads better.
    let r = std::array::from_fn(|i| m[(i / 3, i % 3)] + 0.0);
    (r, (iso.translation.vector / MILLIMETRE).add_scalar(0.0).into())
}

/// Reads a JSON file. `levels` names what the outermost keys and list positions are, such as `["image"]`.
///
/// # Errors
/// [`Error::Io`], or [`Error::Invalid`] with the place in the file in those words, the field and the value.
pub(super) fn load<T: DeserializeOwned>(path: &Path, levels: &[&str]) -> Result<T> {
    let text = files::read_to_string(path)?;
    let mut json = serde_json::Deserializer::from_str(&text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let place = place(error.path(), levels);
        let inner = error.inner();
        let rest = text.lines().nth(inner.line().saturating_sub(1)).unwrap_or("");
        let near: String = rest.chars().skip(inner.column().saturating_sub(3)).take(16).collect();
        let mut message = format!("{place}{inner}");
        if inner.is_syntax() || message.contains("key") {
            message.push_str(&format!(", near `{near}`"));
        }
        let padded =
            near.split_once("\"0").is_some_and(|(_, rest)| rest.starts_with(|c: char| c.is_ascii_digit()));
        if padded || message.contains("key") {
            message.push_str("; keys are numbers without zeros before them, as in \"0\"");
        }
        if ["NaN", "Infinity"].iter().any(|word| near.contains(word)) {
            message.push_str("; NaN and Infinity are no numbers in JSON: write a finite one");
        }
        Error::invalid(path, message)
    })?;
    json.end().map_err(|error| Error::invalid(path, format!("{error}; the file must end there")))?;
    Ok(value)
}

/// `image 3, ground truth 0, cam_t_m2c: `, or nothing at the top.
fn place(path: &serde_path_to_error::Path, levels: &[&str]) -> String {
    use serde_path_to_error::Segment;
    let mut text = String::new();
    for (depth, segment) in path.iter().enumerate() {
        let before = if depth == 0 { "" } else { ", " };
        match (segment, levels.get(depth)) {
            (Segment::Map { key }, Some(level)) => text.push_str(&format!("{before}{level} {key}")),
            (Segment::Seq { index }, Some(level)) => text.push_str(&format!("{before}{level} {index}")),
            (Segment::Map { key }, None) => text.push_str(&format!("{before}{key}")),
            (Segment::Seq { index }, None) => text.push_str(&format!("[{index}]")),
            _ => {}
        }
    }
    if !text.is_empty() {
        text.push_str(": ");
    }
    text
}

/// The JSON text of a map with one entry a line, as the toolkit writes it.
pub(super) fn lines<T: Serialize>(path: &Path, map: &BTreeMap<u32, T>) -> Result<String> {
    let mut text = String::from("{\n");
    for (position, (key, value)) in map.iter().enumerate() {
        let comma = if position + 1 == map.len() { "" } else { "," };
        text.push_str(&format!("  \"{key}\": {}{comma}\n", to_json(path, value)?));
    }
    text.push_str("}\n");
    Ok(text)
}

/// JSON in one line. Numbers read back as the same bits.
pub(super) fn to_json<T: Serialize>(path: &Path, value: &T) -> Result<String> {
    serde_json::to_string(value).map_err(|error| Error::invalid(path, format!("cannot be written: {error}")))
}

/// A list of exactly `N` numbers.
fn numbers<'de, const N: usize, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<[f64; N], D::Error> {
    exactly(Vec::deserialize(deserializer)?)
}

fn optional_numbers<'de, const N: usize, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Option<[f64; N]>, D::Error> {
    Option::<Vec<f64>>::deserialize(deserializer)?.map(exactly).transpose()
}

fn matrices<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Vec<[f64; 16]>, D::Error> {
    Vec::<Vec<f64>>::deserialize(deserializer)?.into_iter().map(exactly).collect()
}

fn exactly<const N: usize, E: serde::de::Error>(values: Vec<f64>) -> std::result::Result<[f64; N], E> {
    values.try_into().map_err(|values: Vec<f64>| {
        let shape = match N {
            9 => " (a 3x3 matrix row by row)",
            16 => " (a 4x4 matrix row by row)",
            _ => "",
        };
        E::custom(format!("{values:?} has {} numbers, must have {N}{shape}", values.len()))
    })
}

/// Writes `root/camera.json`.
///
/// # Errors
/// If it cannot be written.
pub fn write_camera(root: &Path, camera: &CameraFile) -> Result<()> {
    let path = root.join("camera.json");
    super::write_atomic(&path, (to_json(&path, camera)? + "\n").as_bytes())
}

/// Writes `root/test_targets_bop19.json`, one target a line.
///
/// # Errors
/// If it cannot be written.
pub fn write_targets(root: &Path, targets: &[Target]) -> Result<()> {
    let path = root.join("test_targets_bop19.json");
    let lines = targets.iter().map(|target| Ok(format!("  {}", to_json(&path, target)?)));
    let text = format!("[\n{}\n]\n", lines.collect::<Result<Vec<_>>>()?.join(",\n"));
    super::write_atomic(&path, text.as_bytes())
}
