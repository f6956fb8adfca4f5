//! ONNX models as exporters write them: weights in files beside the model (PyTorch's `NAME.onnx.data`) are taken into it, and are
//! inputs of it no more.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path};

use grip_sim::files;
use prost::Message;
use tract_onnx::pb::tensor_proto::{DataLocation, DataType};
use tract_onnx::pb::{GraphProto, ModelProto, TensorProto, ValueInfoProto, tensor_shape_proto, type_proto};

/// The model in one piece, with only what is given as inputs; the bytes themselves where it is so.
///
/// # Errors
/// Which tensor, which file, and what is wrong; the caller names the model.
pub(super) fn whole<'a>(model: &'a [u8], folder: &Path) -> Result<Cow<'a, [u8]>, String> {
    // What cannot be decoded tells the runtime, in its own words.
    let Ok(mut proto) = ModelProto::decode(model) else { return Ok(Cow::Borrowed(model)) };
    let mut reader = Reader { folder, files: HashMap::new() };
    let mut changed = false;
    if let Some(graph) = &mut proto.graph {
        reader.graph(graph)?;
        // As older exporters list them: weights that could be given as inputs, too. tract counts them twice.
        let weights: HashSet<&str> = graph.initializer.iter().map(|tensor| tensor.name.as_str()).collect();
        let count = graph.input.len();
        graph.input.retain(|input| !weights.contains(input.name.as_str()));
        changed = count != graph.input.len();
    }
    if reader.files.is_empty() && !changed {
        return Ok(Cow::Borrowed(model));
    }
    Ok(Cow::Owned(proto.encode_to_vec()))
}

/// Refuses a model with other inputs and outputs than a detector's, before a runtime does so in its own words.
///
/// # Errors
/// What it has, and what is wanted; the caller names the model.
pub(super) fn fits(model: &[u8]) -> Result<(), String> {
    let proto = ModelProto::decode(model).map_err(|error| format!("no ONNX model: {error}"))?;
    let graph = proto.graph.as_ref().ok_or("no ONNX model: it has no graph")?;
    match &graph.input[..] {
        [image] if image.name == "image" && is_float(image, [Some(1), Some(3), None, None]) => {}
        inputs => {
            return Err(format!(
                "has the inputs {}; a detector has one, 'image', float of (1, 3, height, width)",
                listed(inputs)
            ));
        }
    }
    for name in ["classes", "shapes"] {
        if !graph.output.iter().any(|output| output.name == name && is_float(output, [None; 4])) {
            return Err(format!(
                "has the outputs {}; a detector has 'classes', float of (1, 1 + objects, rows, columns), and 'shapes', float of \
                 (1, aspect ratios, rows, columns)",
                listed(&graph.output)
            ));
        }
    }
    Ok(())
}

fn tensor(value: &ValueInfoProto) -> Option<&type_proto::Tensor> {
    let type_proto::Value::TensorType(tensor) = value.r#type.as_ref()?.value.as_ref()?;
    Some(tensor)
}

/// Sizes along the axes, where they are fixed.
fn sizes(tensor: &type_proto::Tensor) -> Option<Vec<Option<i64>>> {
    let size = |axis: &tensor_shape_proto::Dimension| match axis.value {
        Some(tensor_shape_proto::dimension::Value::DimValue(size)) => Some(size),
        _ => None,
    };
    Some(tensor.shape.as_ref()?.dim.iter().map(size).collect())
}

/// Whether a value is a tensor of floats; what it does not say of its shape, or leaves open, fits.
fn is_float(value: &ValueInfoProto, wanted: [Option<i64>; 4]) -> bool {
    let fits = |sizes: Vec<Option<i64>>| {
        let pairs =
            || sizes.iter().zip(&wanted).filter_map(|(has, wanted)| Some((has.as_ref()?, wanted.as_ref()?)));
        sizes.len() == wanted.len() && pairs().all(|(has, wanted)| has == wanted)
    };
    tensor(value)
        .is_some_and(|tensor| tensor.elem_type == DataType::Float as i32 && sizes(tensor).is_none_or(fits))
}

/// `image float16 (1, 3, ?, ?)`.
fn listed(values: &[ValueInfoProto]) -> String {
    let one = |value: &ValueInfoProto| {
        let kind = tensor(value).and_then(|tensor| DataType::try_from(tensor.elem_type).ok());
        let kind = kind.map_or("no tensor".to_owned(), |kind| kind.as_str_name().to_lowercase());
        let shape = tensor(value).and_then(sizes).map_or(String::new(), |sizes| {
            let size = |size: &Option<i64>| size.map_or("?".to_owned(), |size| size.to_string());
            format!(" ({})", sizes.iter().map(size).collect::<Vec<_>>().join(", "))
        });
        format!("{} {kind}{shape}", value.name)
    };
    if values.is_empty() { "none".to_owned() } else { values.iter().map(one).collect::<Vec<_>>().join(", ") }
}

struct Reader<'a> {
    folder: &'a Path,
    /// Those read, by their names.
    files: HashMap<String, Cow<'static, [u8]>>,
}

impl Reader<'_> {
    fn graph(&mut self, graph: &mut GraphProto) -> Result<(), String> {
        for tensor in &mut graph.initializer {
            self.tensor(tensor)?;
        }
        for attribute in graph.node.iter_mut().flat_map(|node| &mut node.attribute) {
            attribute
                .t
                .iter_mut()
                .chain(&mut attribute.tensors)
                .try_for_each(|tensor| self.tensor(tensor))?;
            attribute.g.iter_mut().chain(&mut attribute.graphs).try_for_each(|graph| self.graph(graph))?;
        }
        Ok(())
    }

    fn tensor(&mut self, tensor: &mut TensorProto) -> Result<(), String> {
        if tensor.data_location != Some(DataLocation::External as i32) {
            return Ok(());
        }
        let name = tensor.name.clone();
        let about = |message: String| format!("the weights '{name}' {message}");
        let entry = |key: &str| {
            tensor.external_data.iter().find(|entry| entry.key == key).map(|entry| entry.value.clone())
        };
        let place = |key: &str| match entry(key) {
            None => Ok(None),
            Some(text) => {
                text.parse::<usize>().map(Some).map_err(|_| about(format!("have {key} = \"{text}\"")))
            }
        };
        let (offset, length) = (place("offset")?.unwrap_or(0), place("length")?);
        let file = entry("location").ok_or_else(|| about("are in a file that is not named".into()))?;
        // A model names files beside it, and none elsewhere.
        if !Path::new(&file).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
        {
            return Err(about(format!("are in '{file}', which is not beside the model")));
        }
        if !self.files.contains_key(&file) {
            let bytes = files::read(&self.folder.join(&file)).map_err(|error| {
                about(format!("are kept in a file of their own: {error}; or save the model in one file (external_data=False)"))
            })?;
            self.files.insert(file.clone(), bytes);
        }
        let bytes = &self.files[&file];
        let end = length.map_or(Some(bytes.len()), |length| offset.checked_add(length));
        let raw = end.and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            about(format!(
                "are at {offset} of '{file}'{}, which has {} bytes; copy it again",
                length.map(|length| format!(" and {length} bytes long")).unwrap_or_default(),
                bytes.len()
            ))
        })?;
        tensor.raw_data = raw.to_vec();
        tensor.external_data.clear();
        tensor.data_location = None;
        Ok(())
    }
}
