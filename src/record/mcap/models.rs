//! Bodies, each cut out of the animated scene (replay.glb) as a file of its own.

use std::collections::{BTreeMap, HashMap};

use anyhow::{Context, Result, ensure};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use serde_json::{Value, json};

/// The animated scene.
pub struct Models<'a> {
    root: Value,
    bytes: &'a [u8],
    /// Nodes by their names.
    named: BTreeMap<String, usize>,
}

/// glTF's number for components of single precision.
const FLOAT: u32 = 5126;

const DAMAGED: &str = "replay.glb: is not the animated scene of a recording; record it again";

impl<'a> Models<'a> {
    /// Of a binary glTF as recordings have it.
    ///
    /// # Errors
    /// When it is none.
    pub fn read(file: &'a [u8]) -> Result<Self> {
        let (root, bytes) = chunks(file).context(DAMAGED)?;
        let root: Value = serde_json::from_slice(root).context(DAMAGED)?;
        let nodes = root["nodes"].as_array().context(DAMAGED)?;
        let named = nodes.iter().enumerate();
        let named = named.filter_map(|(i, node)| Some((node["name"].as_str()?.to_owned(), i))).collect();
        Ok(Self { named, root, bytes })
    }

    /// Names of bodies that begin so.
    pub fn names(&self, prefix: &'a str) -> impl Iterator<Item = &str> {
        self.named.keys().map(String::as_str).filter(move |name| name.starts_with(prefix))
    }

    /// A file with these bodies, each at its origin; y is up, as glTF has it. Nothing where none has a mesh.
    ///
    /// # Errors
    /// When the scene is damaged.
    pub fn cut(&self, names: &[&str]) -> Result<Option<Vec<u8>>> {
        let mut cut = Cut::new(self);
        let quarter = std::f32::consts::FRAC_1_SQRT_2;
        cut.lists.insert("nodes", vec![json!({ "rotation": [-quarter, 0.0, 0.0, quarter] })]);
        let mut children = Vec::new();
        for name in names {
            for part in self.parts(name) {
                let mut node = part.clone();
                node["mesh"] = cut.copied("meshes", &part["mesh"])?;
                let nodes = cut.lists.entry("nodes").or_default();
                children.push(nodes.len());
                nodes.push(node);
            }
        }
        if children.is_empty() {
            return Ok(None);
        }
        if let Some(world) = cut.lists.get_mut("nodes").and_then(|nodes| nodes.first_mut()) {
            world["children"] = json!(children);
        }
        cut.finish().map(Some)
    }

    /// The vertices of a body, metres, in its frame.
    ///
    /// # Errors
    /// When the scene is damaged.
    pub fn vertices(&self, name: &str) -> Result<Vec<Point3<f64>>> {
        let mut all = Vec::new();
        for part in self.parts(name) {
            let pose = pose(part);
            let mesh = self.at("meshes", &part["mesh"])?;
            for primitive in mesh["primitives"].as_array().into_iter().flatten() {
                let accessor = self.at("accessors", &primitive["attributes"]["POSITION"])?;
                ensure!(accessor["componentType"] == FLOAT && accessor["type"] == "VEC3", DAMAGED);
                let bytes = self.view(&accessor["bufferView"])?;
                for vertex in bytes.chunks_exact(12) {
                    let number = |k: usize| {
                        let four = [vertex[4 * k], vertex[4 * k + 1], vertex[4 * k + 2], vertex[4 * k + 3]];
                        f64::from(f32::from_le_bytes(four))
                    };
                    all.push(pose * Point3::new(number(0), number(1), number(2)));
                }
            }
        }
        Ok(all)
    }

    /// Nodes with meshes below the one of this name.
    fn parts(&self, name: &str) -> impl Iterator<Item = &Value> {
        let nodes = &self.root["nodes"];
        let children = self.named.get(name).and_then(|&body| nodes[body]["children"].as_array());
        let children = children.into_iter().flatten().filter_map(Value::as_u64);
        children.map(move |child| &nodes[child as usize]).filter(|node| node["mesh"].is_u64())
    }

    fn at(&self, list: &str, index: &Value) -> Result<&Value> {
        let found = index.as_u64().and_then(|index| self.root[list].get(index as usize));
        found.with_context(|| format!("{DAMAGED}: {list} {index}"))
    }

    fn view(&self, index: &Value) -> Result<&'a [u8]> {
        let view = self.at("bufferViews", index)?;
        let number = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        let (from, length) = (number("byteOffset"), number("byteLength"));
        let end = from.checked_add(length);
        end.and_then(|end| self.bytes.get(from..end)).context(DAMAGED)
    }
}

/// JSON and bytes of a binary glTF.
fn chunks(file: &[u8]) -> Option<(&[u8], &[u8])> {
    let number = |at: usize| Some(u32::from_le_bytes(file.get(at..at + 4)?.try_into().ok()?) as usize);
    let text = number(12)?;
    let rest = 20usize.checked_add(text)?;
    (file.get(..4)? == b"glTF" && file.get(16..20)? == b"JSON").then_some(())?;
    let bytes = number(rest)?;
    Some((file.get(20..rest)?, file.get(rest + 8..rest.checked_add(8)?.checked_add(bytes)?)?))
}

fn pose(node: &Value) -> Isometry3<f64> {
    let number = |key: &str, k: usize, default: f64| node[key][k].as_f64().unwrap_or(default);
    let [x, y, z] = [0, 1, 2].map(|k| number("translation", k, 0.0));
    let [i, j, k] = [0, 1, 2].map(|k| number("rotation", k, 0.0));
    let rotation = Quaternion::new(number("rotation", 3, 1.0), i, j, k);
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(rotation))
}

/// What names what in a file: a list, the keys in it, and the list that they are of.
const NAMED: [(&str, &str, &str); 6] = [
    ("primitives", "indices", "accessors"),
    ("primitives", "material", "materials"),
    ("accessors", "bufferView", "bufferViews"),
    ("images", "bufferView", "bufferViews"),
    ("textures", "source", "images"),
    ("baseColorTexture", "index", "textures"),
];

/// A file that is being cut out.
struct Cut<'a> {
    from: &'a Models<'a>,
    lists: BTreeMap<&'static str, Vec<Value>>,
    /// New positions, by list and old position.
    known: HashMap<(&'static str, u64), usize>,
    bytes: Vec<u8>,
}

impl<'a> Cut<'a> {
    fn new(from: &'a Models<'a>) -> Self {
        Self { from, lists: BTreeMap::new(), known: HashMap::new(), bytes: Vec::new() }
    }

    /// Copies a member of a list with all that it needs, once; its new position.
    fn copied(&mut self, list: &'static str, index: &Value) -> Result<Value> {
        let old = index.as_u64().context(DAMAGED)?;
        if let Some(known) = self.known.get(&(list, old)) {
            return Ok(json!(known));
        }
        let mut member = self.from.at(list, index)?.clone();
        self.follow(list, &mut member)?;
        if list == "bufferViews" {
            let bytes = self.from.view(index)?;
            while !self.bytes.len().is_multiple_of(4) {
                self.bytes.push(0);
            }
            member["byteOffset"] = json!(self.bytes.len());
            self.bytes.extend_from_slice(bytes);
        }
        let new = self.lists.entry(list).or_default();
        new.push(member);
        self.known.insert((list, old), new.len() - 1);
        Ok(json!(new.len() - 1))
    }

    /// Copies what a value names, and lets it name the copies.
    fn follow(&mut self, what: &str, value: &mut Value) -> Result<()> {
        for (_, key, list) in NAMED.iter().filter(|(of, ..)| *of == what) {
            if let Some(named) = value.get_mut(key) {
                *named = self.copied(list, &named.clone())?;
            }
        }
        match value {
            Value::Object(inside) => {
                for (key, value) in inside {
                    if key == "attributes" {
                        for accessor in value.as_object_mut().into_iter().flat_map(|all| all.values_mut()) {
                            *accessor = self.copied("accessors", &accessor.clone())?;
                        }
                    } else {
                        self.follow(key, value)?;
                    }
                }
            }
            Value::Array(inside) => inside.iter_mut().try_for_each(|value| self.follow(what, value))?,
            _ => {}
        }
        Ok(())
    }

    fn finish(self) -> Result<Vec<u8>> {
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "grip" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "buffers": [{ "byteLength": self.bytes.len() }],
        });
        for (name, list) in self.lists {
            root[name] = Value::Array(list);
        }
        let binary = crate::record::glb::binary(&root, self.bytes)?;
        ensure!(Models::read(&binary).is_ok(), DAMAGED);
        Ok(binary)
    }
}
