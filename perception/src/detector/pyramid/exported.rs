//! ONNX models as exporters write them: weights in files beside the model (PyTorch's `NAME.onnx.data`) are taken into it, and are
//! inputs of it no more.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path};

use grip_sim::files;
use prost::Message;
use tract_onnx::pb::tensor_proto::DataLocation;
use tract_onnx::pb::{GraphProto, ModelProto, TensorProto};

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
