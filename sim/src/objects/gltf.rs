//! glTF 2.0 files, `.gltf` and `.glb`: triangles with their nodes' transforms, colours and texture.
//!
//! Read here and not by the `gltf` crate, because that (1.4.1) panics at files that are cut off, whose accessors hold nothing, or
//! whose header is shorter than itself.
//!
//! The format has y up and z to the front; here z is up and x stays, as importers of z-up programs have it.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use nalgebra::{Isometry3, Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use crate::error::Error;
use crate::mesh::{Material, Mesh};
use crate::render::srgb;
use crate::robot::mesh_part::Part;
use crate::{files, pictures};

type Result<T> = std::result::Result<T, String>;

/// Deepest nesting of nodes; deeper files are taken for a cycle.
const MAX_DEPTH: usize = 64;
/// Most nodes that are drawn.
const MAX_NODES: usize = 100_000;
/// Extensions that change nothing that is read here, or that this reader follows.
const KNOWN: [&str; 2] = ["KHR_mesh_quantization", "KHR_lights_punctual"];

/// Every drawn triangle mesh of a file, in metres, z up.
///
/// # Errors
/// What is wrong with the file, in words; the caller names it.
pub(super) fn load(path: &Path) -> Result<Vec<Part>> {
    let bytes = files::read(path).map_err(Error::without_file)?;
    let (json, blob) = if bytes.starts_with(b"glTF") { chunks(&bytes)? } else { (&*bytes, None) };
    let root: Root = serde_json::from_slice(json).map_err(|error| format!("is no glTF: {error}"))?;
    if !root.asset.version.starts_with("2.") {
        return Err(format!("is glTF {}; version 2 is read: export it anew", root.asset.version));
    }
    for name in &root.extensions_required {
        if !KNOWN.contains(&name.as_str()) && !name.starts_with("KHR_materials_") {
            return Err(format!("needs the extension {name}, which is not read; export it without"));
        }
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    let buffers = root.buffers.iter().enumerate().map(|(i, buffer)| match (&buffer.uri, blob) {
        (Some(uri), _) => data(uri, folder).map_err(|reason| format!("buffers[{i}]: {reason}")),
        (None, Some(blob)) if i == 0 => Ok(Cow::Borrowed(blob)),
        (None, _) => Err(format!("buffers[{i}] has neither a uri nor a chunk of its own")),
    });
    let buffers = buffers.collect::<Result<Vec<_>>>()?;
    let mut reader = Reader {
        root: &root,
        folder,
        buffers,
        images: vec![None; root.images.len()],
        parts: vec![],
        nodes: 0,
    };
    // From y up to z up: x stays, y becomes z.
    let up = Matrix4::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let scene = root.scenes.get(root.scene.unwrap_or(0));
    let roots = scene.map_or_else(|| root.without_parents(), |scene| scene.nodes.clone());
    for node in roots {
        reader.node(node, &up, 0)?;
    }
    Ok(reader.parts)
}

/// The JSON of a binary file, and its bytes if it has any.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let number = |at: usize| -> Result<usize> {
        let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).ok_or("is cut off")?;
        Ok(u32::from_le_bytes(four) as usize)
    };
    if number(4)? != 2 {
        return Err(format!("is binary glTF {}; version 2 is read: export it anew", number(4)?));
    }
    if number(8)? > bytes.len() {
        return Err(format!("is cut off: it has {} of {} bytes", bytes.len(), number(8)?));
    }
    let chunk = |at: usize| -> Result<&[u8]> {
        Ok(bytes.get(at + 8..).and_then(|rest| rest.get(..number(at).ok()?)).ok_or("is cut off")?)
    };
    let json = chunk(12)?;
    // Chunks begin at multiples of four.
    let second = 20 + json.len().next_multiple_of(4);
    let blob = if second + 8 <= bytes.len() { Some(chunk(second)?) } else { None };
    Ok((json, blob))
}

/// What a URI names: bytes in the text itself, or a file.
fn data(uri: &str, folder: &Path) -> Result<Cow<'static, [u8]>> {
    match uri.strip_prefix("data:") {
        Some(rest) => {
            let text = rest.split_once(";base64,").ok_or("is a data URI without base64")?.1;
            STANDARD.decode(text).map(Cow::Owned).map_err(|error| format!("its base64 is broken: {error}"))
        }
        None => files::read(&files::named(folder, uri)).map_err(|error| error.to_string()),
    }
}

struct Reader<'a> {
    root: &'a Root,
    folder: &'a Path,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Those that were asked for.
    images: Vec<Option<Arc<RgbImage>>>,
    parts: Vec<Part>,
    nodes: usize,
}

impl Reader<'_> {
    fn node(&mut self, index: usize, parent: &Matrix4<f64>, depth: usize) -> Result<()> {
        self.nodes += 1;
        if depth > MAX_DEPTH || self.nodes > MAX_NODES {
            return Err(format!(
                "nodes are nested more than {MAX_DEPTH} deep, more than {MAX_NODES}, or in a circle"
            ));
        }
        let root = self.root;
        let node = root.nodes.get(index).ok_or_else(|| missing("nodes", index, root.nodes.len()))?;
        let transform = parent * node.transform();
        if let Some(mesh) = node.mesh {
            if node.skin.is_some() {
                return Err("holds a skinned mesh; export it as a plain mesh".into());
            }
            let meshes = &root.meshes;
            let mesh = meshes.get(mesh).ok_or_else(|| missing("meshes", mesh, meshes.len()))?;
            for primitive in &mesh.primitives {
                self.primitive(primitive, &transform)?;
            }
        }
        node.children.iter().try_for_each(|child| self.node(*child, &transform, depth + 1))
    }

    fn primitive(&mut self, primitive: &Primitive, transform: &Matrix4<f64>) -> Result<()> {
        let Primitive { attributes, indices, material, mode } = primitive;
        if !(4..=6).contains(mode) {
            // Points and lines.
            return Ok(());
        }
        let Some(position) = attributes.position else { return Ok(()) };
        let positions = self.accessor(position, "POSITION", &[3])?;
        let count = positions.values.len() / 3;
        let indices: Vec<u32> = match indices {
            Some(index) => self.accessor(*index, "indices", &[1])?.values.iter().map(|v| *v as u32).collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|index| **index as usize >= count) {
            return Err(format!("a triangle names vertex {index} of {count}"));
        }
        let mut triangles: Vec<[u32; 3]> = match mode {
            4 => indices.as_chunks::<3>().0.to_vec(),
            5 => {
                // Every second triangle of a strip is wound the other way.
                let turned = |(i, t): (usize, &[u32])| {
                    if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] }
                };
                indices.windows(3).enumerate().map(turned).collect()
            }
            _ => indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
        };
        let linear = transform.fixed_view::<3, 3>(0, 0).into_owned();
        if linear.determinant() < 0.0 {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let mut mesh = Mesh { triangles, ..Mesh::default() };
        mesh.positions = positions
            .values
            .as_chunks::<3>()
            .0
            .iter()
            .map(|p| transform.transform_point(&Point3::from(*p)).cast())
            .collect();
        let whole = |values: &Accessed| values.values.len() / values.components == count;
        if let Some(normal) = attributes.normal {
            let normals = self.accessor(normal, "NORMAL", &[3])?;
            if let (true, Some(inverse)) = (whole(&normals), linear.try_inverse()) {
                let turn = |n: &[f64; 3]| (inverse.transpose() * Vector3::from(*n)).cast();
                mesh.normals = normals.values.as_chunks::<3>().0.iter().map(turn).collect();
            }
        }
        let (material, texture) = self.material(*material)?;
        if let Some(set) = texture {
            let uvs = attributes.texcoord(set).ok_or_else(|| {
                format!("has a texture with the coordinates TEXCOORD_{set}, which a mesh of it lacks")
            })?;
            let uvs = self.accessor(uvs, "TEXCOORD", &[2])?;
            if whole(&uvs) {
                mesh.uvs = uvs.values.as_chunks::<2>().0.iter().map(|uv| uv.map(|v| v as f32)).collect();
            }
        }
        if let Some(color) = attributes.color {
            let colors = self.accessor(color, "COLOR_0", &[3, 4])?;
            if whole(&colors) {
                let code = |v: &f64| (255.0 * srgb::from_linear(v.clamp(0.0, 1.0) as f32)).round() as u8;
                let each = colors.values.chunks_exact(colors.components);
                mesh.colors = each.map(|c| [code(&c[0]), code(&c[1]), code(&c[2])]).collect();
            }
        }
        self.parts.push(Part { mesh, material: Some(material) });
        Ok(())
    }

    /// The material, and the set of coordinates of its texture if it has one.
    fn material(&mut self, index: Option<usize>) -> Result<(Material, Option<u32>)> {
        let root = self.root;
        let Some(index) = index else { return Ok((Material::default(), None)) };
        let all = &root.materials;
        let pbr = &all.get(index).ok_or_else(|| missing("materials", index, all.len()))?.pbr;
        let [r, g, b, _] = pbr.base_color_factor;
        let mut material = Material {
            base_color: [r, g, b].map(|v| srgb::from_linear(v.clamp(0.0, 1.0))),
            ..Material::default()
        };
        // The two factors alone say nothing where a picture of both is meant to be multiplied by them.
        if pbr.metallic_roughness_texture.is_none() {
            material.roughness = pbr.roughness_factor.clamp(0.0, 1.0);
            material.metallic = pbr.metallic_factor.clamp(0.0, 1.0);
        }
        let Some(info) = &pbr.base_color_texture else { return Ok((material, None)) };
        let texture = root.textures.get(info.index);
        let texture = texture.ok_or_else(|| missing("textures", info.index, root.textures.len()))?;
        let source =
            texture.source.ok_or("has a texture in a format that needs an extension; export PNG or JPEG")?;
        material.texture = Some(self.image(source)?);
        Ok((material, Some(info.tex_coord)))
    }

    fn image(&mut self, index: usize) -> Result<Arc<RgbImage>> {
        let root = self.root;
        let image = root.images.get(index).ok_or_else(|| missing("images", index, root.images.len()))?;
        if let Some(known) = &self.images[index] {
            return Ok(Arc::clone(known));
        }
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => data(uri, self.folder),
            (None, Some(view)) => self.view(view).map(|(bytes, _)| Cow::Owned(bytes.to_vec())),
            (None, None) => Err("has neither a uri nor a bufferView".into()),
        };
        let picture = bytes.and_then(|bytes| pictures::stored_bytes(&bytes));
        let picture = Arc::new(picture.map_err(|reason| format!("images[{index}]: {reason}"))?);
        self.images[index] = Some(Arc::clone(&picture));
        Ok(picture)
    }

    /// The bytes of a view of a buffer, and its stride if it has one.
    fn view(&self, index: usize) -> Result<(&[u8], Option<usize>)> {
        let views = &self.root.buffer_views;
        let view = views.get(index).ok_or_else(|| missing("bufferViews", index, views.len()))?;
        let buffer = self.buffers.get(view.buffer);
        let buffer = buffer.ok_or_else(|| missing("buffers", view.buffer, self.buffers.len()))?;
        let bytes = buffer.get(view.byte_offset..).and_then(|rest| rest.get(..view.byte_length));
        let beyond = || format!("bufferViews[{index}] reaches beyond the {} bytes there are", buffer.len());
        Ok((bytes.ok_or_else(beyond)?, view.byte_stride))
    }

    /// Numbers of an accessor, which must have one of these numbers of components.
    fn accessor(&self, index: usize, what: &str, components: &[usize]) -> Result<Accessed> {
        let accessors = &self.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| missing("accessors", index, accessors.len()))?;
        let wrong = |reason: String| format!("accessors[{index}], {what}: {reason}");
        let each = match accessor.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => return Err(wrong(format!("is of type {other}"))),
        };
        if !components.contains(&each) {
            return Err(wrong(format!("is of type {}", accessor.kind)));
        }
        if accessor.sparse.is_some() {
            return Err(wrong("is sparse, which is not read; export it plainly".into()));
        }
        type Number = (usize, fn(&[u8]) -> f64, f64);
        let (size, read, most): Number = match accessor.component_type {
            5120 => (1, |b| f64::from(b[0] as i8), 127.0),
            5121 => (1, |b| f64::from(b[0]), 255.0),
            5122 => (2, |b| f64::from(i16::from_le_bytes([b[0], b[1]])), 32_767.0),
            5123 => (2, |b| f64::from(u16::from_le_bytes([b[0], b[1]])), 65_535.0),
            5125 => (4, |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), 4_294_967_295.0),
            5126 => (4, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
            other => return Err(wrong(format!("has componentType {other}, which there is not"))),
        };
        let view = accessor.buffer_view.ok_or_else(|| wrong("has no bufferView".into()))?;
        let (bytes, stride) = self.view(view).map_err(wrong)?;
        let stride = stride.unwrap_or(size * each).max(1);
        let last = accessor.count.checked_sub(1).and_then(|last| last.checked_mul(stride));
        let end = last.and_then(|last| last.checked_add(accessor.byte_offset)?.checked_add(size * each));
        if accessor.count > 0 && end.is_none_or(|end| end > bytes.len()) {
            return Err(wrong(format!("reaches beyond the {} bytes there are", bytes.len())));
        }
        let scale = if accessor.normalized { 1.0 / most } else { 1.0 };
        let values = (0..accessor.count).flat_map(|i| {
            let at = accessor.byte_offset + i * stride;
            (0..each).map(move |k| scale * read(&bytes[at + k * size..]))
        });
        Ok(Accessed { values: values.collect(), components: each })
    }
}

/// Numbers, so many a vertex.
struct Accessed {
    values: Vec<f64>,
    components: usize,
}

fn missing(list: &str, index: usize, count: usize) -> String {
    format!("names {list}[{index}], but there are {count}")
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Root {
    asset: Asset,
    scene: Option<usize>,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Primitives>,
    #[serde(default)]
    materials: Vec<MaterialOf>,
    #[serde(default)]
    textures: Vec<Texture>,
    #[serde(default)]
    images: Vec<ImageOf>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<View>,
    #[serde(default)]
    buffers: Vec<Buffer>,
}

impl Root {
    /// What is drawn of a file without scenes.
    fn without_parents(&self) -> Vec<usize> {
        let children: HashSet<usize> =
            self.nodes.iter().flat_map(|node| node.children.iter().copied()).collect();
        (0..self.nodes.len()).filter(|index| !children.contains(index)).collect()
    }
}

#[derive(Debug, Deserialize)]
struct Asset {
    version: String,
}

#[derive(Debug, Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Debug, Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<usize>,
    mesh: Option<usize>,
    skin: Option<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    /// x, y, z, w.
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

impl Node {
    fn transform(&self) -> Matrix4<f64> {
        if let Some(columns) = &self.matrix {
            return Matrix4::from_column_slice(columns);
        }
        let [x, y, z, w] = self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9).unwrap_or_default();
        let translation = Translation3::from(self.translation.unwrap_or_default());
        let scale = Vector3::from(self.scale.unwrap_or([1.0; 3]));
        Isometry3::from_parts(translation, rotation).to_homogeneous()
            * Matrix4::new_nonuniform_scaling(&scale)
    }
}

#[derive(Debug, Deserialize)]
struct Primitives {
    primitives: Vec<Primitive>,
}

#[derive(Debug, Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    material: Option<usize>,
    #[serde(default = "triangles")]
    mode: u32,
}

fn triangles() -> u32 {
    4
}

#[derive(Debug, Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
    #[serde(rename = "NORMAL")]
    normal: Option<usize>,
    #[serde(rename = "COLOR_0")]
    color: Option<usize>,
    #[serde(rename = "TEXCOORD_0")]
    texcoord_0: Option<usize>,
    #[serde(rename = "TEXCOORD_1")]
    texcoord_1: Option<usize>,
}

impl Attributes {
    fn texcoord(&self, set: u32) -> Option<usize> {
        match set {
            0 => self.texcoord_0,
            1 => self.texcoord_1,
            _ => None,
        }
    }
}

#[derive(Debug, Deserialize)]
struct MaterialOf {
    #[serde(rename = "pbrMetallicRoughness", default)]
    pbr: Pbr,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Pbr {
    /// Linear.
    base_color_factor: [f32; 4],
    base_color_texture: Option<TextureInfo>,
    metallic_factor: f32,
    roughness_factor: f32,
    metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for Pbr {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct TextureInfo {
    index: usize,
    #[serde(default)]
    tex_coord: u32,
}

#[derive(Debug, Deserialize)]
struct Texture {
    source: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct ImageOf {
    uri: Option<String>,
    buffer_view: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    kind: String,
    sparse: Option<serde_json::Value>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Debug, Deserialize)]
struct Buffer {
    uri: Option<String>,
}
