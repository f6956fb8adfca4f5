//! COLLADA (`.dae`) meshes, as far as robot descriptions use them.
//!
//! Read here and not by the mesh-loader crate, because that (0.1.13) multiplies nested nodes in the wrong order, keeps
//! only the last place of a mesh that is drawn several times, leaves normals unturned, and panics at malformed files.
//!
//! As RViz and MoveIt do, the file's length unit is applied and its `up_axis` is not: a URDF's author places the
//! mesh as its coordinates stand.

use std::collections::HashMap;
use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node};

use super::mesh_part::{Part, texture};
use crate::files::text;
use crate::mesh::{Material, Mesh};
use crate::polygon;

/// Deepest nesting of nodes; deeper files are taken for a cycle.
const MAX_DEPTH: usize = 64;
/// Most nodes that are drawn: a circle of nodes that name themselves twice would grow without end before it is deep.
const MAX_NODES: usize = 100_000;

type Result<T> = std::result::Result<T, String>;

/// Every drawn triangle mesh of a file, in metres.
pub(super) fn load(bytes: &[u8], folder: Option<&Path>) -> Result<Vec<Part>> {
    let text = text::xml(bytes.into())?;
    let document = Document::parse(&text).map_err(|error| format!("is not XML: {error}"))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(format!("is <{}>, not <COLLADA>", root.tag_name().name()));
    }
    let mut reader = Reader { by_id: HashMap::new(), folder, parts: Vec::new(), nodes: 0 };
    for node in document.descendants().filter(Node::is_element) {
        if let Some(id) = node.attribute("id") {
            reader.by_id.entry(id).or_insert(node);
        }
    }
    let unit = match find(root, &["asset", "unit"]).and_then(|unit| unit.attribute("meter")) {
        Some(text) => number(text)?,
        None => 1.0,
    };
    if unit <= 0.0 {
        return Err(format!("<unit meter=\"{unit}\">: must be above 0"));
    }
    let scale = Matrix4::new_scaling(unit);
    let scene = match find(root, &["scene", "instance_visual_scene"]) {
        Some(instance) => Some(reader.target(instance, "url")?),
        None => find(root, &["library_visual_scenes", "visual_scene"]),
    };
    match scene {
        Some(scene) => {
            for node in children(scene, "node") {
                reader.node(node, &scale, 0)?;
            }
        }
        None => {
            for library in children(root, "library_geometries") {
                for geometry in children(library, "geometry") {
                    reader.geometry(geometry, &scale, &HashMap::new())?;
                }
            }
        }
    }
    Ok(reader.parts)
}

struct Reader<'a, 'input> {
    by_id: HashMap<&'a str, Node<'a, 'input>>,
    folder: Option<&'a Path>,
    parts: Vec<Part>,
    nodes: usize,
}

impl<'a, 'input> Reader<'a, 'input> {
    /// The element that an attribute such as `url="#id"` names.
    fn target(&self, node: Node<'a, 'input>, attribute: &str) -> Result<Node<'a, 'input>> {
        let tag = node.tag_name().name();
        let url = node.attribute(attribute).ok_or_else(|| format!("<{tag}> has no {attribute}"))?;
        url.strip_prefix('#')
            .and_then(|id| self.by_id.get(id))
            .copied()
            .ok_or_else(|| format!("<{tag} {attribute}=\"{url}\"> names nothing in this file"))
    }

    fn node(&mut self, node: Node<'a, 'input>, parent: &Matrix4<f64>, depth: usize) -> Result<()> {
        self.nodes += 1;
        if depth > MAX_DEPTH || self.nodes > MAX_NODES {
            return Err(format!(
                "nodes are nested more than {MAX_DEPTH} deep, more than {MAX_NODES}, or in a circle"
            ));
        }
        // Cameras and lamps, which some exporters place by transformations that meshes never have.
        let draws = |n: Node<'_, '_>| {
            matches!(n.tag_name().name(), "instance_geometry" | "instance_node" | "instance_controller")
        };
        if !node.descendants().any(draws) {
            return Ok(());
        }
        let mut transform = *parent;
        for child in node.children().filter(Node::is_element) {
            if let Some(step) = transformation(child)? {
                transform *= step;
            }
        }
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "node" => self.node(child, &transform, depth + 1)?,
                "instance_node" => {
                    let target = self.target(child, "url")?;
                    self.node(target, &transform, depth + 1)?;
                }
                "instance_geometry" => {
                    let mut bound = HashMap::new();
                    for bind in child.descendants().filter(|n| n.has_tag_name_local("instance_material")) {
                        if let Some(symbol) = bind.attribute("symbol") {
                            bound.insert(symbol, self.target(bind, "target")?);
                        }
                    }
                    let geometry = self.target(child, "url")?;
                    self.geometry(geometry, &transform, &bound)?;
                }
                "instance_controller" => {
                    return Err(
                        "holds a skinned mesh (<instance_controller>); export it as a plain mesh".into()
                    );
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(
        &mut self,
        geometry: Node<'a, 'input>,
        transform: &Matrix4<f64>,
        bound: &HashMap<&str, Node<'a, 'input>>,
    ) -> Result<()> {
        for mesh in children(geometry, "mesh") {
            for primitive in mesh.children().filter(Node::is_element) {
                let tag = primitive.tag_name().name();
                if !matches!(tag, "triangles" | "polylist" | "polygons" | "trifans" | "tristrips") {
                    continue;
                }
                let mesh =
                    self.primitive(primitive, transform).map_err(|error| format!("<{tag}>: {error}"))?;
                let material = primitive
                    .attribute("material")
                    .and_then(|symbol| bound.get(symbol))
                    .map(|&material| self.material(material))
                    .transpose()?;
                self.parts.push(Part { mesh, material });
            }
        }
        Ok(())
    }

    fn primitive(&self, primitive: Node<'a, 'input>, transform: &Matrix4<f64>) -> Result<Mesh> {
        if children(primitive, "ph").next().is_some() {
            return Err("polygons with holes (<ph>) are not supported; export triangles".into());
        }
        let inputs = self.inputs(primitive)?;
        let stride = inputs.stride;
        let mut faces: Vec<Vec<&[usize]>> = Vec::new();
        let lists: Vec<Vec<usize>> =
            children(primitive, "p").map(|p| indices(p.text().unwrap_or(""))).collect::<Result<_>>()?;
        let corners = |list: &'_ [usize]| -> Result<()> {
            if list.len().is_multiple_of(stride) {
                Ok(())
            } else {
                Err(format!("{} indices are no multiple of {stride}", list.len()))
            }
        };
        for list in &lists {
            corners(list)?;
            let corner: Vec<&[usize]> = list.chunks_exact(stride).collect();
            match primitive.tag_name().name() {
                "triangles" => {
                    if !corner.len().is_multiple_of(3) {
                        return Err(format!("{} corners are no multiple of 3", corner.len()));
                    }
                    faces.extend(corner.chunks_exact(3).map(<[_]>::to_vec));
                }
                "polylist" => {
                    let counts = children(primitive, "vcount")
                        .next()
                        .map(|v| indices(v.text().unwrap_or("")))
                        .transpose()?
                        .ok_or("has no <vcount>")?;
                    let mut rest = corner.as_slice();
                    for count in counts {
                        let (face, after) =
                            rest.split_at_checked(count).ok_or("<p> is shorter than <vcount> says")?;
                        faces.push(face.to_vec());
                        rest = after;
                    }
                    if !rest.is_empty() {
                        return Err("<p> is longer than <vcount> says".into());
                    }
                }
                "tristrips" => {
                    faces.extend(corner.windows(3).enumerate().map(|(i, w)| {
                        if i % 2 == 0 { vec![w[0], w[1], w[2]] } else { vec![w[1], w[0], w[2]] }
                    }))
                }
                // One polygon or fan a <p>.
                _ => faces.push(corner),
            }
        }
        // Corners are not shared: positions, normals and texture coordinates each have their own index.
        let mut mesh = Mesh::default();
        let linear: Matrix3<f64> = transform.fixed_view::<3, 3>(0, 0).into();
        let normal_transform = linear.try_inverse().map(|inverse| inverse.transpose());
        if linear.determinant().abs() < 1e-30 {
            return Err("its node or unit scales it to nothing".into());
        }
        let fan = matches!(primitive.tag_name().name(), "triangles" | "trifans" | "tristrips");
        for face in &faces {
            let cut = if fan {
                (1..face.len().saturating_sub(1)).map(|i| [0, i, i + 1]).collect()
            } else {
                let corners: Vec<Vector3<f64>> = face
                    .iter()
                    .map(|corner| Ok(inputs.position.get(corner)?.into()))
                    .collect::<Result<_>>()?;
                polygon::triangles(&corners)
            };
            for triangle in cut {
                let first = mesh.positions.len() as u32;
                for corner in triangle.map(|i| face[i]) {
                    let [x, y, z] = inputs.position.get(corner)?;
                    let p = transform.transform_point(&Point3::new(x, y, z));
                    mesh.positions.push(p.cast::<f32>());
                    if let (Some(normal), Some(turn)) = (&inputs.normal, &normal_transform) {
                        let n = turn * Vector3::from(normal.get(corner)?);
                        mesh.normals.push(n.try_normalize(1e-12).unwrap_or_default().cast::<f32>());
                    }
                    if let Some(uv) = &inputs.uv {
                        let [u, v, _] = uv.get(corner)?;
                        // COLLADA's v points up, ours down.
                        mesh.uvs.push([u as f32, 1.0 - v as f32]);
                    }
                    if let Some(color) = &inputs.color {
                        let rgb = color.get(corner)?;
                        mesh.colors.push(rgb.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8));
                    }
                }
                mesh.triangles.push([first, first + 1, first + 2]);
            }
        }
        if linear.determinant() < 0.0 {
            for triangle in &mut mesh.triangles {
                triangle.swap(1, 2);
            }
        }
        Ok(mesh)
    }

    fn inputs(&self, primitive: Node<'a, 'input>) -> Result<Inputs> {
        let mut found = (None, None, None, None);
        let mut stride = 1;
        for input in children(primitive, "input") {
            let offset = match input.attribute("offset") {
                Some(text) => indices(text)?.first().copied().unwrap_or(0),
                None => 0,
            };
            if offset > 64 {
                return Err(format!("<input> offset {offset} is out of reason"));
            }
            stride = stride.max(offset + 1);
            let source = self.target(input, "source")?;
            // <vertices> bundles the inputs that share the vertex index.
            let bundle: Vec<_> = if input.attribute("semantic") == Some("VERTEX") {
                children(source, "input")
                    .map(|inner| Ok((inner.attribute("semantic"), self.target(inner, "source")?)))
                    .collect::<Result<_>>()?
            } else {
                vec![(input.attribute("semantic"), source)]
            };
            for (semantic, source) in bundle {
                let slot = match semantic {
                    Some("POSITION") => &mut found.0,
                    Some("NORMAL") => &mut found.1,
                    Some("TEXCOORD") => &mut found.2,
                    Some("COLOR") => &mut found.3,
                    _ => continue,
                };
                // The first set of several.
                if slot.is_none() {
                    *slot = Some(self.source(source, offset)?);
                }
            }
        }
        Ok(Inputs {
            position: found.0.ok_or("has no input POSITION")?,
            normal: found.1,
            uv: found.2,
            color: found.3,
            stride,
        })
    }

    fn source(&self, source: Node<'a, 'input>, offset: usize) -> Result<Input> {
        let name = source.attribute("id").unwrap_or("");
        let array = children(source, "float_array")
            .next()
            .ok_or_else(|| format!("source '{name}' has no <float_array>"))?;
        let values = numbers(array.text().unwrap_or(""))?;
        let accessor = find(source, &["technique_common", "accessor"]);
        let attribute = |name: &str, default: usize| -> Result<usize> {
            match accessor.and_then(|accessor| accessor.attribute(name)) {
                Some(text) => Ok(indices(text)?.first().copied().unwrap_or(default)),
                None => Ok(default),
            }
        };
        Ok(Input {
            name: name.to_string(),
            values,
            start: attribute("offset", 0)?,
            stride: attribute("stride", 3)?.max(1),
            offset,
        })
    }

    /// Diffuse colour or texture of a `<material>`.
    fn material(&self, material: Node<'a, 'input>) -> Result<Material> {
        let mut result = Material::default();
        let Some(instance) = children(material, "instance_effect").next() else {
            return Ok(result);
        };
        let effect = self.target(instance, "url")?;
        let Some(diffuse) = effect.descendants().find(|node| node.has_tag_name_local("diffuse")) else {
            return Ok(result);
        };
        if let Some(color) = children(diffuse, "color").next() {
            let rgba = numbers(color.text().unwrap_or(""))?;
            if let [r, g, b, ..] = rgba[..] {
                result.base_color = [r, g, b].map(|c| c.clamp(0.0, 1.0) as f32);
            }
        }
        if let Some(used) = children(diffuse, "texture").next() {
            result.base_color = [1.0; 3];
            let file = self.texture_file(effect, used.attribute("texture").unwrap_or(""))?;
            result.texture = Some(texture(&file, self.folder)?);
        }
        Ok(result)
    }

    /// From a sampler's name over its surface to the image's file; shorter ways are taken where exporters leave parts out.
    fn texture_file(&self, effect: Node<'a, 'input>, sampler: &str) -> Result<String> {
        let parameter = |name: &str| {
            effect
                .descendants()
                .find(|node| node.has_tag_name_local("newparam") && node.attribute("sid") == Some(name))
        };
        let text_of = |node: Node<'a, 'input>, tag: &str| {
            node.descendants().find(|n| n.has_tag_name_local(tag)).and_then(|n| n.text()).map(str::trim)
        };
        let surface = parameter(sampler).and_then(|node| text_of(node, "source")).unwrap_or(sampler);
        let image = parameter(surface).and_then(|node| text_of(node, "init_from")).unwrap_or(surface);
        self.by_id
            .get(image)
            .and_then(|image| text_of(*image, "init_from"))
            .map(str::to_string)
            .ok_or_else(|| format!("texture '{sampler}' leads to no image file"))
    }
}

/// One input of a primitive, and where its index stands among the indices of a corner.
struct Input {
    name: String,
    values: Vec<f64>,
    start: usize,
    stride: usize,
    offset: usize,
}

impl Input {
    /// Three values (or two and a zero) of a corner.
    fn get(&self, corner: &[usize]) -> Result<[f64; 3]> {
        let index = corner[self.offset];
        let first = index.checked_mul(self.stride).and_then(|at| at.checked_add(self.start));
        first
            .and_then(|first| self.values.get(first..first.checked_add(self.stride.min(3))?))
            .map(|values| {
                let mut result = [0.0; 3];
                result[..values.len()].copy_from_slice(values);
                result
            })
            .ok_or_else(|| {
                format!("index {index} is beyond source '{}' of {} values", self.name, self.values.len())
            })
    }
}

struct Inputs {
    position: Input,
    normal: Option<Input>,
    uv: Option<Input>,
    color: Option<Input>,
    stride: usize,
}

/// The matrix of a transformation element; `None` for any other element.
fn transformation(element: Node<'_, '_>) -> Result<Option<Matrix4<f64>>> {
    let tag = element.tag_name().name();
    let count = match tag {
        "matrix" => 16,
        "translate" | "scale" => 3,
        "rotate" => 4,
        "lookat" | "skew" => return Err(format!("<{tag}> in a node is not supported")),
        _ => return Ok(None),
    };
    let v = numbers(element.text().unwrap_or(""))?;
    if v.len() != count {
        return Err(format!("<{tag}> has {} numbers, not {count}", v.len()));
    }
    Ok(Some(match tag {
        "matrix" => Matrix4::from_row_slice(&v),
        "translate" => Matrix4::new_translation(&Vector3::new(v[0], v[1], v[2])),
        "scale" => Matrix4::new_nonuniform_scaling(&Vector3::new(v[0], v[1], v[2])),
        _ => Unit::try_new(Vector3::new(v[0], v[1], v[2]), 1e-12).map_or_else(Matrix4::identity, |axis| {
            Rotation3::from_axis_angle(&axis, v[3].to_radians()).to_homogeneous()
        }),
    }))
}

/// Tag names are compared without their namespace, which exporters set as they please.
trait LocalName {
    fn has_tag_name_local(&self, name: &str) -> bool;
}

impl LocalName for Node<'_, '_> {
    fn has_tag_name_local(&self, name: &str) -> bool {
        self.is_element() && self.tag_name().name() == name
    }
}

fn children<'a, 'input: 'a>(node: Node<'a, 'input>, name: &'a str) -> impl Iterator<Item = Node<'a, 'input>> {
    node.children().filter(move |child| child.has_tag_name_local(name))
}

fn find<'a, 'input>(node: Node<'a, 'input>, path: &[&str]) -> Option<Node<'a, 'input>> {
    path.iter().try_fold(node, |node, name| node.children().find(|child| child.has_tag_name_local(name)))
}

fn number(text: &str) -> Result<f64> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|value| value.is_finite())
        .ok_or_else(|| format!("'{}' is not a finite number", text.trim()))
}

fn numbers(text: &str) -> Result<Vec<f64>> {
    text.split_ascii_whitespace().map(number).collect()
}

fn indices(text: &str) -> Result<Vec<usize>> {
    text.split_ascii_whitespace()
        .map(|index| index.parse().map_err(|_| format!("'{index}' is not an index")))
        .collect()
}
