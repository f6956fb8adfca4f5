//! The messages: Foxglove's schemas, field by field as they are published, with all fields, since viewers look for those that are never
//! used here, too; and one of our own.

use super::proto::{Bytes, enumerations, messages};

messages! {
    /// Since the simulation began.
    Timestamp in "google/protobuf/timestamp.proto" as "google.protobuf.Timestamp" {
        1 seconds: i64,
        2 nanos: i32,
    }
    Duration in "google/protobuf/duration.proto" as "google.protobuf.Duration" {
        1 seconds: i64,
        2 nanos: i32,
    }
    Vector3 in "foxglove/Vector3.proto" as "foxglove.Vector3" {
        1 x: f64,
        2 y: f64,
        3 z: f64,
    }
    Point3 in "foxglove/Point3.proto" as "foxglove.Point3" {
        1 x: f64,
        2 y: f64,
        3 z: f64,
    }
    Point2 in "foxglove/Point2.proto" as "foxglove.Point2" {
        1 x: f64,
        2 y: f64,
    }
    Quaternion in "foxglove/Quaternion.proto" as "foxglove.Quaternion" {
        1 x: f64,
        2 y: f64,
        3 z: f64,
        4 w: f64,
    }
    Pose in "foxglove/Pose.proto" as "foxglove.Pose" {
        1 position: Vector3,
        2 orientation: Quaternion,
    }
    Color in "foxglove/Color.proto" as "foxglove.Color" {
        1 r: f64,
        2 g: f64,
        3 b: f64,
        4 a: f64,
    }
    KeyValuePair in "foxglove/KeyValuePair.proto" as "foxglove.KeyValuePair" {
        1 key: String,
        2 value: String,
    }
    FrameTransform in "foxglove/FrameTransform.proto" as "foxglove.FrameTransform" {
        1 timestamp: Timestamp,
        2 parent_frame_id: String,
        3 child_frame_id: String,
        4 translation: Vector3,
        5 rotation: Quaternion,
    }
    FrameTransforms in "foxglove/FrameTransforms.proto" as "foxglove.FrameTransforms" {
        1 transforms: Vec<FrameTransform>,
    }
    JointState in "foxglove/JointState.proto" as "foxglove.JointState" {
        1 name: String,
        2 position: Option<f64>,
        3 velocity: Option<f64>,
        4 acceleration: Option<f64>,
        5 effort: Option<f64>,
    }
    JointStates in "foxglove/JointStates.proto" as "foxglove.JointStates" {
        1 timestamp: Timestamp,
        2 joints: Vec<JointState>,
    }
    CompressedImage in "foxglove/CompressedImage.proto" as "foxglove.CompressedImage" {
        1 timestamp: Timestamp,
        4 frame_id: String,
        2 data: Bytes,
        3 format: String,
    }
    RawImage in "foxglove/RawImage.proto" as "foxglove.RawImage" {
        1 timestamp: Timestamp,
        7 frame_id: String,
        2 width: u32,
        3 height: u32,
        4 encoding: String,
        5 step: u32,
        6 data: Bytes,
    }
    #[allow(non_snake_case, reason = "the schema's names")]
    CameraCalibration in "foxglove/CameraCalibration.proto" as "foxglove.CameraCalibration" {
        1 timestamp: Timestamp,
        9 frame_id: String,
        2 width: u32,
        3 height: u32,
        4 distortion_model: String,
        5 D: Vec<f64>,
        6 K: Vec<f64>,
        7 R: Vec<f64>,
        8 P: Vec<f64>,
    }
    PackedElementField in "foxglove/PackedElementField.proto" as "foxglove.PackedElementField" {
        1 name: String,
        2 offset: u32,
        3 r#type: NumericType,
    }
    PointCloud in "foxglove/PointCloud.proto" as "foxglove.PointCloud" {
        1 timestamp: Timestamp,
        2 frame_id: String,
        3 pose: Pose,
        4 point_stride: u32,
        5 fields: Vec<PackedElementField>,
        6 data: Bytes,
    }
    ArrowPrimitive in "foxglove/ArrowPrimitive.proto" as "foxglove.ArrowPrimitive" {
        1 pose: Pose,
        2 shaft_length: f64,
        3 shaft_diameter: f64,
        4 head_length: f64,
        5 head_diameter: f64,
        6 color: Color,
    }
    CubePrimitive in "foxglove/CubePrimitive.proto" as "foxglove.CubePrimitive" {
        1 pose: Pose,
        2 size: Vector3,
        3 color: Color,
    }
    SpherePrimitive in "foxglove/SpherePrimitive.proto" as "foxglove.SpherePrimitive" {
        1 pose: Pose,
        2 size: Vector3,
        3 color: Color,
    }
    CylinderPrimitive in "foxglove/CylinderPrimitive.proto" as "foxglove.CylinderPrimitive" {
        1 pose: Pose,
        2 size: Vector3,
        3 bottom_scale: f64,
        4 top_scale: f64,
        5 color: Color,
    }
    LinePrimitive in "foxglove/LinePrimitive.proto" as "foxglove.LinePrimitive" {
        1 r#type: LineType,
        2 pose: Pose,
        3 thickness: f64,
        4 scale_invariant: bool,
        5 points: Vec<Point3>,
        6 color: Color,
        7 colors: Vec<Color>,
        8 indices: Vec<u32>,
    }
    TriangleListPrimitive in "foxglove/TriangleListPrimitive.proto" as "foxglove.TriangleListPrimitive" {
        1 pose: Pose,
        2 points: Vec<Point3>,
        3 color: Color,
        4 colors: Vec<Color>,
        5 indices: Vec<u32>,
    }
    TextPrimitive in "foxglove/TextPrimitive.proto" as "foxglove.TextPrimitive" {
        1 pose: Pose,
        2 billboard: bool,
        3 font_size: f64,
        4 scale_invariant: bool,
        5 color: Color,
        6 text: String,
    }
    ModelPrimitive in "foxglove/ModelPrimitive.proto" as "foxglove.ModelPrimitive" {
        1 pose: Pose,
        2 scale: Vector3,
        3 color: Color,
        4 override_color: bool,
        5 url: String,
        6 media_type: String,
        7 data: Bytes,
    }
    SceneEntityDeletion in "foxglove/SceneEntityDeletion.proto" as "foxglove.SceneEntityDeletion" {
        1 timestamp: Timestamp,
        2 r#type: DeletionType,
        3 id: String,
    }
    SceneEntity in "foxglove/SceneEntity.proto" as "foxglove.SceneEntity" {
        1 timestamp: Timestamp,
        2 frame_id: String,
        3 id: String,
        4 lifetime: Duration,
        5 frame_locked: bool,
        6 metadata: Vec<KeyValuePair>,
        7 arrows: Vec<ArrowPrimitive>,
        8 cubes: Vec<CubePrimitive>,
        9 spheres: Vec<SpherePrimitive>,
        10 cylinders: Vec<CylinderPrimitive>,
        11 lines: Vec<LinePrimitive>,
        12 triangles: Vec<TriangleListPrimitive>,
        13 texts: Vec<TextPrimitive>,
        14 models: Vec<ModelPrimitive>,
    }
    SceneUpdate in "foxglove/SceneUpdate.proto" as "foxglove.SceneUpdate" {
        1 deletions: Vec<SceneEntityDeletion>,
        2 entities: Vec<SceneEntity>,
    }
    CircleAnnotation in "foxglove/CircleAnnotation.proto" as "foxglove.CircleAnnotation" {
        1 timestamp: Timestamp,
        2 position: Point2,
        3 diameter: f64,
        4 thickness: f64,
        5 fill_color: Color,
        6 outline_color: Color,
        7 metadata: Vec<KeyValuePair>,
    }
    PointsAnnotation in "foxglove/PointsAnnotation.proto" as "foxglove.PointsAnnotation" {
        1 timestamp: Timestamp,
        2 r#type: PointsType,
        3 points: Vec<Point2>,
        4 outline_color: Color,
        5 outline_colors: Vec<Color>,
        6 fill_color: Color,
        7 thickness: f64,
        8 metadata: Vec<KeyValuePair>,
    }
    TextAnnotation in "foxglove/TextAnnotation.proto" as "foxglove.TextAnnotation" {
        1 timestamp: Timestamp,
        2 position: Point2,
        3 text: String,
        4 font_size: f64,
        5 text_color: Color,
        6 background_color: Color,
        7 metadata: Vec<KeyValuePair>,
    }
    ImageAnnotations in "foxglove/ImageAnnotations.proto" as "foxglove.ImageAnnotations" {
        5 timestamp: Timestamp,
        1 circles: Vec<CircleAnnotation>,
        2 points: Vec<PointsAnnotation>,
        3 texts: Vec<TextAnnotation>,
        4 metadata: Vec<KeyValuePair>,
    }
    Log in "foxglove/Log.proto" as "foxglove.Log" {
        1 timestamp: Timestamp,
        2 level: LogLevel,
        3 message: String,
        4 name: String,
        5 file: String,
        6 line: u32,
    }
    /// What the hand and its drives feel, and the object in it: metres, newtons, degrees.
    Gripper in "grip/Gripper.proto" as "grip.Gripper" {
        1 timestamp: Timestamp,
        2 step: String,
        3 width_m: f64,
        4 grip_force_n: f64,
        5 hand_force_n: Vector3,
        6 link_force_n: f64,
        7 right_finger_n: f64,
        8 left_finger_n: f64,
        9 support_n: f64,
        10 slip_m: f64,
        11 slip_deg: f64,
    }
}

enumerations! {
    NumericType as "foxglove.PackedElementField.NumericType" {
        Unknown = "UNKNOWN", Uint8 = "UINT8", Int8 = "INT8", Uint16 = "UINT16", Int16 = "INT16", Uint32 = "UINT32", Int32 = "INT32",
        Float32 = "FLOAT32", Float64 = "FLOAT64",
    }
    LineType as "foxglove.LinePrimitive.Type" {
        Strip = "LINE_STRIP", Loop = "LINE_LOOP", List = "LINE_LIST",
    }
    DeletionType as "foxglove.SceneEntityDeletion.Type" {
        MatchingId = "MATCHING_ID", All = "ALL",
    }
    PointsType as "foxglove.PointsAnnotation.Type" {
        Unknown = "UNKNOWN", Points = "POINTS", LineLoop = "LINE_LOOP", LineStrip = "LINE_STRIP", LineList = "LINE_LIST",
    }
    LogLevel as "foxglove.Log.Level" {
        Unknown = "UNKNOWN", Debug = "DEBUG", Info = "INFO", Warning = "WARNING", Error = "ERROR", Fatal = "FATAL",
    }
}
