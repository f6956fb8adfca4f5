//! What the camera saw at each look, and the estimates in its picture.

use anyhow::Result;
use grip_sim::camera::Intrinsics;
use nalgebra::Point3;

use super::models::Models;
use super::proto::Bytes;
use super::schemas::{
    CameraCalibration, CompressedImage, ImageAnnotations, NumericType, PackedElementField, Point2,
    PointCloud, PointsAnnotation, PointsType, RawImage, TextAnnotation,
};
use super::source::{Look, Source};
use super::{CAMERA, Out, color, estimate_color, numbered, object_frame, pose, timestamp};

/// A cloud has at most so many points.
const POINTS: usize = 20_000;
/// Bytes of a point: three coordinates and four parts of the colour.
const STRIDE: usize = 16;

/// Says all of it.
///
/// # Errors
/// When the animated scene lacks something.
pub fn tell(source: &Source, models: &Models<'_>, out: &mut Out) -> Result<()> {
    let camera = &source.about.intrinsics;
    let (width, height) = (camera.width as u32, camera.height as u32);
    for look in &source.looks {
        let stamp = || timestamp(look.time_s);
        let picture = CompressedImage {
            timestamp: stamp(),
            frame_id: CAMERA.to_owned(),
            data: Bytes(look.png.clone()),
            format: "png".to_owned(),
        };
        let depth = RawImage {
            timestamp: stamp(),
            frame_id: CAMERA.to_owned(),
            width,
            height,
            encoding: "16UC1".to_owned(),
            step: 2 * width,
            data: Bytes(look.depth.iter().flat_map(|mm| mm.to_le_bytes()).collect()),
        };
        let Intrinsics { fx, fy, cx, cy, .. } = *camera;
        let calibration = CameraCalibration {
            timestamp: stamp(),
            frame_id: CAMERA.to_owned(),
            width,
            height,
            // Pictures have no distortion.
            distortion_model: String::new(),
            D: Vec::new(),
            K: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            R: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            P: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        };
        out.say("/camera/info", look.time_s, &calibration);
        out.say("/camera/color", look.time_s, &picture);
        out.say("/camera/depth", look.time_s, &depth);
        out.say("/camera/points", look.time_s, &cloud(look, camera));
        out.say("/camera/annotations", look.time_s, &annotations(look, source, models)?);
    }
    Ok(())
}

/// A reading of every few rows and columns, so that the cloud looks the same all over.
fn cloud(look: &Look, camera: &Intrinsics) -> PointCloud {
    let readings = |every: usize| {
        let rows = (0..camera.height).step_by(every);
        let pixels = rows.flat_map(move |v| (0..camera.width).step_by(every).map(move |u| (u, v)));
        pixels.filter(|&(u, v)| look.depth[v * camera.width + u] > 0)
    };
    let every = (1..).find(|&every| readings(every).count() <= POINTS).unwrap_or(1);
    let mut data = Vec::new();
    for (u, v) in readings(every) {
        let z = f64::from(look.depth[v * camera.width + u]) / 1000.0;
        let at = [(u as f64 - camera.cx) / camera.fx * z, (v as f64 - camera.cy) / camera.fy * z, z];
        at.iter().for_each(|part| data.extend_from_slice(&(*part as f32).to_le_bytes()));
        data.extend_from_slice(&look.rgb.get_pixel(u as u32, v as u32).0);
        data.push(255);
    }
    let field = |name: &str, offset: u32, kind: NumericType| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: kind,
    };
    let single = NumericType::Float32;
    let byte = NumericType::Uint8;
    PointCloud {
        timestamp: timestamp(look.time_s),
        frame_id: CAMERA.to_owned(),
        pose: pose(&nalgebra::Isometry3::identity()),
        point_stride: STRIDE as u32,
        fields: vec![
            field("x", 0, single),
            field("y", 4, single),
            field("z", 8, single),
            field("red", 12, byte),
            field("green", 13, byte),
            field("blue", 14, byte),
            field("alpha", 15, byte),
        ],
        data: Bytes(data),
    }
}

/// A box around each estimate that is in the picture, with its name.
fn annotations(look: &Look, source: &Source, models: &Models<'_>) -> Result<ImageAnnotations> {
    let stamp = || timestamp(look.time_s);
    let mut all = ImageAnnotations { timestamp: stamp(), ..Default::default() };
    for estimate in source.estimates.iter().filter(|estimate| estimate.look == look.look) {
        let vertices = models.vertices(&object_frame(&estimate.object, estimate.instance))?;
        let camera_from_object = look.camera.inverse() * estimate.pose;
        let points = vertices.iter().map(|vertex| camera_from_object * vertex);
        let Some([left, top, right, bottom]) = bounds(points, &source.about.intrinsics) else { continue };
        let tint = || estimate_color(estimate.believed, 1.0);
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        all.points.push(PointsAnnotation {
            timestamp: stamp(),
            r#type: PointsType::LineLoop,
            points: corners.map(|(x, y)| Point2 { x, y }).into(),
            outline_color: tint(),
            thickness: 2.0,
            ..Default::default()
        });
        let name = numbered(&estimate.object, estimate.instance);
        all.texts.push(TextAnnotation {
            timestamp: stamp(),
            position: Point2 { x: left, y: top },
            text: format!("{name} {:.2}", estimate.confidence),
            font_size: 12.0,
            text_color: color([1.0; 4]),
            background_color: tint(),
            ..Default::default()
        });
    }
    Ok(all)
}

/// Left, top, right and bottom of what is seen of points in the camera's frame; nothing where none is.
fn bounds(points: impl Iterator<Item = Point3<f64>>, camera: &Intrinsics) -> Option<[f64; 4]> {
    let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let around = points.filter(|p| p.z > 1e-3).fold(none, |[left, top, right, bottom], p| {
        let (u, v) = (camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy);
        [left.min(u), top.min(v), right.max(u), bottom.max(v)]
    });
    let [left, top, right, bottom] = around;
    let (most_u, most_v) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    let seen = [left.max(0.0), top.max(0.0), right.min(most_u), bottom.min(most_v)];
    (seen[0] < seen[2] && seen[1] < seen[3]).then_some(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A metre away, a decimetre is fx / 10 pixels.
    #[test]
    fn a_box_is_where_its_points_are_seen() {
        let camera = Intrinsics::FETCH;
        let corners = [Point3::new(-0.05, -0.1, 1.0), Point3::new(0.05, 0.1, 1.0)];
        let seen = bounds(corners.into_iter(), &camera).unwrap();
        let expected = [319.5 - 27.713, 239.5 - 55.426, 319.5 + 27.713, 239.5 + 55.426];
        assert!(seen.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{seen:?}");
        assert_eq!(bounds([Point3::new(0.0, 0.0, -1.0)].into_iter(), &camera), None);
        let beside = [Point3::new(5.0, 0.0, 1.0), Point3::new(5.1, 0.1, 1.0)];
        assert_eq!(bounds(beside.into_iter(), &camera), None);
    }
}
