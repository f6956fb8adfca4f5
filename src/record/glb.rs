//! glTF 2.0 in one binary file (.glb): what stood where, animated, for the page's own viewer, Blender and any other.
//!
//! The frame is glTF's, y up: the node `world` turns it. Bodies are children of that, by their names; below each are its meshes.

use std::collections::HashMap;
use std::sync::Arc;

use anyhow::Result;
use grip_sim::images::RgbImage;
use grip_sim::mesh::{Material, Visual};
use grip_sim::render::srgb;
use nalgebra::Isometry3;
use serde_json::{Map, Value, json};

use crate::pictures;

/// A colour and how much of what is behind it is seen, 0 to 1, sRGB.
pub type Tint = [f32; 4];

/// Meshes of one body, each with body from mesh.
pub type Parts = Vec<(Isometry3<f64>, Arc<Visual>)>;

/// How a node moves: seconds, position and quaternion. Between two it goes straight; it must not be empty.
pub type Track = Vec<(f32, [f32; 3], [f32; 4])>;

/// A file that is being made.
#[derive(Debug, Default)]
pub struct Glb {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    images: Vec<Value>,
    nodes: Vec<Value>,
    children: Vec<usize>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
    /// Meshes by what they are of.
    known: HashMap<(usize, Option<[u32; 4]>), usize>,
    attributes: HashMap<usize, (Value, usize)>,
    pictures: HashMap<usize, usize>,
}

/// Kinds of components.
const FLOAT: u32 = 5126;
const UNSIGNED: u32 = 5125;
const SHORT: u32 = 5123;
/// What a view is for.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

impl Glb {
    /// An empty scene.
    pub fn new() -> Self {
        let mut glb = Self::default();
        let quarter = std::f32::consts::FRAC_1_SQRT_2;
        glb.nodes.push(json!({ "name": "world", "rotation": [-quarter, 0.0, 0.0, quarter] }));
        glb
    }

    /// Adds a body that stands still.
    ///
    /// # Errors
    /// When a texture cannot be encoded.
    pub fn still(&mut self, name: &str, pose: &Isometry3<f64>, parts: &Parts) -> Result<usize> {
        let (translation, rotation) = split(pose);
        let node = self.body(name, parts, None)?;
        self.nodes[node]["translation"] = json!(translation);
        self.nodes[node]["rotation"] = json!(rotation);
        Ok(node)
    }

    /// Adds a body that moves.
    ///
    /// # Errors
    /// When a texture cannot be encoded.
    pub fn moving(&mut self, name: &str, parts: &Parts, track: &Track) -> Result<usize> {
        let node = self.body(name, parts, None)?;
        if let Some((_, position, rotation)) = track.first() {
            self.nodes[node]["translation"] = json!(position);
            self.nodes[node]["rotation"] = json!(rotation);
        }
        if track.len() > 1 {
            let times: Vec<f32> = track.iter().map(|key| key.0).collect();
            let input = self.numbers(&times, 1, None);
            let positions: Vec<f32> = track.iter().flat_map(|key| key.1).collect();
            let rotations: Vec<f32> = track.iter().flat_map(|key| key.2).collect();
            let output = self.numbers(&positions, 3, None);
            self.channel(node, "translation", (input, output), "LINEAR");
            let output = self.numbers(&rotations, 4, None);
            self.channel(node, "rotation", (input, output), "LINEAR");
        }
        Ok(node)
    }

    /// Adds a copy of a body in one colour that is there from `from` to `to` alone, seconds.
    ///
    /// # Errors
    /// When a texture cannot be encoded.
    pub fn ghost(
        &mut self,
        name: &str,
        (pose, parts): (&Isometry3<f64>, &Parts),
        tint: Tint,
        there: (f32, f32),
    ) -> Result<()> {
        let (translation, rotation) = split(pose);
        let node = self.body(name, parts, Some(tint))?;
        self.nodes[node]["translation"] = json!(translation);
        self.nodes[node]["rotation"] = json!(rotation);
        self.shown(node, there);
        Ok(())
    }

    /// Adds a line in one colour that is there from `from` to `to` alone, seconds.
    pub fn line(&mut self, name: &str, points: &[[f32; 3]], tint: Tint, there: (f32, f32)) {
        if points.len() < 2 {
            return;
        }
        let flat: Vec<f32> = points.iter().flatten().copied().collect();
        let positions = self.numbers(&flat, 3, Some(VERTICES));
        let material = self.plain(tint, true);
        self.meshes.push(json!({ "name": name, "primitives": [
            { "attributes": { "POSITION": positions }, "material": material, "mode": 3 }
        ] }));
        self.nodes.push(json!({ "name": name, "mesh": self.meshes.len() - 1 }));
        let node = self.nodes.len() - 1;
        self.children.push(node);
        self.shown(node, there);
    }

    /// The file.
    ///
    /// # Errors
    /// When the JSON cannot be written.
    pub fn finish(mut self, extras: Value) -> Result<Vec<u8>> {
        self.nodes[0]["children"] = json!(self.children);
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let mut root = Map::new();
        root.insert("asset".into(), json!({ "version": "2.0", "generator": "grip" }));
        root.insert("scene".into(), json!(0));
        root.insert("scenes".into(), json!([{ "nodes": [0], "extras": extras }]));
        for (name, list) in [
            ("nodes", self.nodes),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("textures", self.textures),
            ("images", self.images),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
        ] {
            // Empty lists are not allowed.
            if !list.is_empty() {
                root.insert(name.into(), Value::Array(list));
            }
        }
        if !self.channels.is_empty() {
            let animation = json!({ "name": "trial", "samplers": self.samplers, "channels": self.channels });
            root.insert("animations".into(), json!([animation]));
        }
        root.insert("buffers".into(), json!([{ "byteLength": self.bytes.len() }]));
        binary(&Value::Object(root), self.bytes)
    }

    fn body(&mut self, name: &str, parts: &Parts, tint: Option<Tint>) -> Result<usize> {
        let mut inside = Vec::new();
        for (pose, visual) in parts {
            let mesh = self.mesh(visual, tint)?;
            let (translation, rotation) = split(pose);
            self.nodes.push(json!({ "mesh": mesh, "translation": translation, "rotation": rotation }));
            inside.push(self.nodes.len() - 1);
        }
        let mut node = json!({ "name": name });
        if !inside.is_empty() {
            node["children"] = json!(inside);
        }
        self.nodes.push(node);
        self.children.push(self.nodes.len() - 1);
        Ok(self.nodes.len() - 1)
    }

    /// A node is there for a while.
    fn shown(&mut self, node: usize, (from, to): (f32, f32)) {
        let mut keys: Vec<(f32, f32)> = vec![(0.0, if from > 0.0 { 0.0 } else { 1.0 })];
        if from > 0.0 {
            keys.push((from, 1.0));
        }
        if to > from {
            keys.push((to, 0.0));
        }
        let first = keys[0].1;
        self.nodes[node]["scale"] = json!([first, first, first]);
        let times: Vec<f32> = keys.iter().map(|key| key.0).collect();
        let scales: Vec<f32> = keys.iter().flat_map(|key| [key.1; 3]).collect();
        let input = self.numbers(&times, 1, None);
        let output = self.numbers(&scales, 3, None);
        self.channel(node, "scale", (input, output), "STEP");
    }

    fn channel(&mut self, node: usize, path: &str, (input, output): (usize, usize), interpolation: &str) {
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        let sampler = self.samplers.len() - 1;
        self.channels.push(json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }

    fn mesh(&mut self, visual: &Arc<Visual>, tint: Option<Tint>) -> Result<usize> {
        let of = Arc::as_ptr(visual) as usize;
        let key = (of, tint.map(|tint| tint.map(f32::to_bits)));
        if let Some(&mesh) = self.known.get(&key) {
            return Ok(mesh);
        }
        let (mut attributes, indices) = match self.attributes.get(&of) {
            Some((attributes, indices)) => (attributes.clone(), *indices),
            None => {
                let (attributes, indices) = self.vertices(visual);
                self.attributes.insert(of, (attributes.clone(), indices));
                (attributes, indices)
            }
        };
        let material = match tint {
            Some(tint) => {
                // In one colour, whatever its own are.
                if let Some(own) = attributes.as_object_mut() {
                    own.retain(|name, _| name == "POSITION" || name == "NORMAL");
                }
                self.plain(tint, false)
            }
            None => self.material(&visual.material)?,
        };
        self.meshes.push(json!({ "primitives": [
            { "attributes": attributes, "indices": indices, "material": material }
        ] }));
        self.known.insert(key, self.meshes.len() - 1);
        Ok(self.meshes.len() - 1)
    }

    fn vertices(&mut self, visual: &Visual) -> (Value, usize) {
        let mesh = &visual.mesh;
        let mut attributes = Map::new();
        let positions: Vec<f32> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        attributes.insert("POSITION".into(), json!(self.numbers(&positions, 3, Some(VERTICES))));
        let normals: Vec<f32> = mesh.normals.iter().flat_map(|n| unit([n.x, n.y, n.z])).collect();
        attributes.insert("NORMAL".into(), json!(self.numbers(&normals, 3, Some(VERTICES))));
        if !mesh.uvs.is_empty() {
            let uvs: Vec<f32> = mesh.uvs.iter().flatten().copied().collect();
            attributes.insert("TEXCOORD_0".into(), json!(self.numbers(&uvs, 2, Some(VERTICES))));
        }
        if !mesh.colors.is_empty() {
            let bytes: Vec<u8> = mesh
                .colors
                .iter()
                .flat_map(|c| c.map(|c| linear(f32::from(c) / 255.0)).into_iter().chain([1.0]))
                .flat_map(|c| ((c * 65535.0).round() as u16).to_le_bytes())
                .collect();
            let view = self.view(&bytes, Some(VERTICES));
            let accessor = json!({
                "bufferView": view, "componentType": SHORT, "normalized": true, "count": mesh.colors.len(), "type": "VEC4"
            });
            self.accessors.push(accessor);
            attributes.insert("COLOR_0".into(), json!(self.accessors.len() - 1));
        }
        let bytes: Vec<u8> = mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(INDICES));
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED, "count": 3 * mesh.triangles.len(), "type": "SCALAR"
        }));
        (Value::Object(attributes), self.accessors.len() - 1)
    }

    fn material(&mut self, material: &Material) -> Result<usize> {
        let [r, g, b] = material.base_color.map(linear);
        let mut surface = json!({
            "baseColorFactor": [r, g, b, 1.0],
            "roughnessFactor": material.roughness,
            "metallicFactor": material.metallic,
        });
        if let Some(texture) = &material.texture {
            surface["baseColorTexture"] = json!({ "index": self.texture(texture)? });
        }
        self.materials.push(json!({ "pbrMetallicRoughness": surface }));
        Ok(self.materials.len() - 1)
    }

    /// Of one colour; a line is not lit.
    fn plain(&mut self, [r, g, b, a]: Tint, line: bool) -> usize {
        let [r, g, b] = [r, g, b].map(linear);
        let surface =
            json!({ "baseColorFactor": [r, g, b, a], "roughnessFactor": 1.0, "metallicFactor": 0.0 });
        let mut material = json!({ "pbrMetallicRoughness": surface });
        if line {
            material["emissiveFactor"] = json!([r, g, b]);
        }
        if a < 1.0 {
            material["alphaMode"] = json!("BLEND");
        }
        self.materials.push(material);
        self.materials.len() - 1
    }

    fn texture(&mut self, texture: &Arc<RgbImage>) -> Result<usize> {
        let of = Arc::as_ptr(texture) as usize;
        if let Some(&known) = self.pictures.get(&of) {
            return Ok(known);
        }
        let bytes = pictures::jpeg(texture)?;
        let view = self.view(&bytes, None);
        self.images.push(json!({ "bufferView": view, "mimeType": "image/jpeg" }));
        self.textures.push(json!({ "source": self.images.len() - 1 }));
        self.pictures.insert(of, self.textures.len() - 1);
        Ok(self.textures.len() - 1)
    }

    /// Adds `width` numbers a row.
    fn numbers(&mut self, values: &[f32], width: usize, target: Option<u32>) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        let bound = |better: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
            (0..width).map(|k| values.iter().skip(k).step_by(width).copied().fold(start, better)).collect()
        };
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": FLOAT,
            "count": values.len() / width,
            "type": kind,
            "min": bound(f32::min, f32::INFINITY),
            "max": bound(f32::max, f32::NEG_INFINITY),
        }));
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }
}

/// A file of this JSON and its buffer.
///
/// # Errors
/// When the JSON cannot be written.
pub fn binary(root: &Value, mut bytes: Vec<u8>) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec(root)?;
    for (chunk, fill) in [(&mut text, b' '), (&mut bytes, 0)] {
        chunk.resize(chunk.len().next_multiple_of(4), fill);
    }
    let total = 12 + 8 + text.len() + 8 + bytes.len();
    let mut file = Vec::with_capacity(total);
    file.extend_from_slice(b"glTF");
    file.extend_from_slice(&2u32.to_le_bytes());
    file.extend_from_slice(&u32::try_from(total)?.to_le_bytes());
    file.extend_from_slice(&(text.len() as u32).to_le_bytes());
    file.extend_from_slice(b"JSON");
    file.extend_from_slice(&text);
    file.extend_from_slice(&(bytes.len() as u32).to_le_bytes());
    file.extend_from_slice(b"BIN\0");
    file.extend_from_slice(&bytes);
    Ok(file)
}

/// Of sRGB, 0 to 1.
fn linear(c: f32) -> f32 {
    srgb::to_linear(c)
}

/// Validators want unit normals to within half a thousandth.
fn unit([x, y, z]: [f32; 3]) -> [f32; 3] {
    let length = (x * x + y * y + z * z).sqrt();
    if length > 1e-6 { [x / length, y / length, z / length] } else { [0.0, 0.0, 1.0] }
}

fn split(pose: &Isometry3<f64>) -> ([f32; 3], [f32; 4]) {
    let (t, q) = (&pose.translation.vector, &pose.rotation);
    ([t.x, t.y, t.z].map(|v| v as f32), [q.i, q.j, q.k, q.w].map(|v| v as f32))
}
