//! Running an ONNX file by ort: tract, which is Rust and built in, or a native ONNX Runtime.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use ort::environment::Environment;
use ort::ep;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::Tensor;
use prost::Message;
use sha2::{Digest, Sha256};
use tract_onnx::pb::{ModelProto, TensorShapeProto, ValueInfoProto, tensor_shape_proto, type_proto};

use super::description::DetectorDescription;
use super::exported::fits;
use super::rehearsal::rehearse;
use crate::error::{Error, Result};

/// Names a native ONNX Runtime, such as `/usr/lib/libonnxruntime.so`.
const LIBRARY: &str = "ORT_DYLIB_PATH";

/// Execution providers of a native ONNX Runtime, in the order in which they are tried; none for its CPU's.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Providers(pub Vec<String>);

impl Providers {
    /// Names that can be asked for.
    pub const NAMES: [&'static str; 8] =
        ["cpu", "cuda", "tensorrt", "rocm", "openvino", "directml", "coreml", "xnnpack"];

    fn dispatch(name: &str) -> Option<ep::ExecutionProviderDispatch> {
        Some(match name {
            "cpu" => ep::CPU::default().build(),
            "cuda" => ep::CUDA::default().build(),
            "tensorrt" => ep::TensorRT::default().build(),
            "rocm" => ep::ROCm::default().build(),
            "openvino" => ep::OpenVINO::default().build(),
            "directml" => ep::DirectML::default().build(),
            "coreml" => ep::CoreML::default().build(),
            "xnnpack" => ep::XNNPACK::default().build(),
            _ => return None,
        })
    }
}

fn fingerprint(model: &[u8]) -> String {
    let mut hex = format!("{:x}", Sha256::digest(model));
    hex.truncate(8);
    hex
}

/// What runs networks in this process; ort has one for all.
struct Runtime {
    environment: Environment,
    native: bool,
}

fn runtime() -> Result<&'static Runtime> {
    static RUNTIME: OnceLock<std::result::Result<Runtime, String>> = OnceLock::new();
    let opened = RUNTIME.get_or_init(|| match std::env::var_os(LIBRARY).filter(|path| !path.is_empty()) {
        Some(path) => {
            let shown = path.to_string_lossy().into_owned();
            let environment = ort::init_from(&path)
                .map_err(|e| format!("{LIBRARY}={shown}: {e}; unset it to use the runtime that is built in"))?
                .with_telemetry(false)
                .build()
                .map_err(|e| format!("{LIBRARY}={shown}: {e}"))?;
            Ok(Runtime { environment, native: true })
        }
        None => {
            ort::set_api(ort_tract::api());
            let environment = ort::init().build().map_err(|e| e.to_string())?;
            Ok(Runtime { environment, native: false })
        }
    });
    opened.as_ref().map_err(|message| Error::Detector(message.clone()))
}

/// Sizes of images that sessions are kept for: the levels of a few pyramids.
const KEPT_SIZES: usize = 32;

/// A network that is ready to run, by several threads at once.
pub(super) struct Network {
    model: Vec<u8>,
    file: String,
    fingerprint: String,
    providers: Providers,
    runtime: String,
    channels: [usize; 2],
    stride: usize,
    native: bool,
    /// A session runs one image at a time, so each thread takes its own. A level runs on one thread: results do not depend on
    /// how many there are. By the size of images; those of a native runtime take any, and are kept as of none.
    sessions: Mutex<BTreeMap<[usize; 2], Vec<Session>>>,
}

impl fmt::Debug for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Network")
            .field("file", &self.file)
            .field("runtime", &self.runtime)
            .finish_non_exhaustive()
    }
}

impl Network {
    /// Loads a model and tries it on a grey image; `file` is for messages. One that is not `ours` is rehearsed before.
    pub fn load(
        model: &[u8],
        file: &str,
        description: &DetectorDescription,
        providers: &Providers,
        ours: bool,
    ) -> Result<Self> {
        let native = runtime()?.native;
        if !native && providers.0.iter().any(|name| name != "cpu") {
            return Err(Error::Detector(format!(
                "execution provider {}: the runtime that is built in has cpu only; set {LIBRARY} to a native ONNX Runtime",
                providers.0.join(", ")
            )));
        }
        let asked = if providers.0.is_empty() { "cpu".to_owned() } else { providers.0.join(", ") };
        let network = Self {
            model: model.to_vec(),
            file: file.to_owned(),
            fingerprint: fingerprint(model),
            providers: providers.clone(),
            runtime: if native { format!("ONNX Runtime ({asked})") } else { "tract".to_owned() },
            channels: [1 + description.objects.len(), description.aspect_ratios.len()],
            stride: description.stride_px,
            native,
            sessions: Mutex::default(),
        };
        // No whole number of cells: these are cut off.
        let (width, height) = (8 * network.stride + 3, 6 * network.stride + 1);
        fits(model).map_err(|message| network.wrong(&message))?;
        if !ours && !native {
            let of_size = network.of_size([width, height])?;
            for (model, size) in [(model, None), (&*of_size, Some([width, height]))] {
                rehearse(model, size).map_err(|message| network.wrong(&message))?;
            }
        }
        network.run(vec![0.5; 3 * width * height], width, height)?;
        Ok(network)
    }

    /// Tells files apart: the first digits of the model's SHA-256.
    pub fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    pub fn runtime(&self) -> &str {
        &self.runtime
    }

    /// Probabilities of classes and of aspect ratios, channel by channel, for an image given as planes of red, green and blue.
    pub fn run(&self, planes: Vec<f32>, width: usize, height: usize) -> Result<(Vec<f32>, Vec<f32>)> {
        let failed = |e: ort::Error| self.wrong(&format!("cannot run on {width}x{height} pixels: {e}"));
        let size = if self.native { [0, 0] } else { [width, height] };
        let free = self.sessions().get_mut(&size).and_then(Vec::pop);
        let mut session = match free {
            Some(session) => session,
            None if self.native => self.session(&self.model)?,
            None => self.session(&self.of_size(size)?)?,
        };
        let input = Tensor::from_array(([1, 3, height, width], planes)).map_err(failed)?;
        let (rows, columns) = (height / self.stride, width / self.stride);
        let outputs = session.run(ort::inputs!["image" => input]).map_err(failed)?;
        let read = |name: &str, channels: usize| {
            let output = outputs.get(name).ok_or_else(|| self.wrong(&format!("gave no output '{name}'")))?;
            let (shape, values) = output.try_extract_tensor::<f32>().map_err(failed)?;
            let wanted = [1, channels as i64, rows as i64, columns as i64];
            if **shape != wanted {
                return Err(self.wrong(&format!(
                    "output '{name}' of an image of {width}x{height} pixels is {shape:?}; its description asks for {wanted:?}"
                )));
            }
            // A little more or less is rounding.
            if let Some(value) = values.iter().find(|x| !(-1e-3..=1.001).contains(*x)) {
                return Err(self.wrong(&format!("output '{name}' has {value}, which is no probability")));
            }
            Ok(values.iter().map(|x| x.clamp(0.0, 1.0)).collect())
        };
        let both = (read("classes", self.channels[0])?, read("shapes", self.channels[1])?);
        drop(outputs);
        let mut sessions = self.sessions();
        // Images of ever new sizes: only the last ones' sessions are worth their memory.
        if sessions.len() >= KEPT_SIZES && !sessions.contains_key(&size) {
            sessions.clear();
        }
        sessions.entry(size).or_default().push(session);
        Ok(both)
    }

    fn sessions(&self) -> MutexGuard<'_, BTreeMap<[usize; 2], Vec<Session>>> {
        self.sessions.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The model for images of one width and height alone: where tract knows the shapes it chooses better convolutions.
    fn of_size(&self, [width, height]: [usize; 2]) -> Result<Cow<'_, [u8]>> {
        let mut proto = ModelProto::decode(self.model.as_slice())
            .map_err(|e| self.wrong(&format!("no ONNX model: {e}")))?;
        let Some(graph) = &mut proto.graph else { return Ok(Cow::Borrowed(&self.model)) };
        let fixed = [1, 3, height, width].map(|n| tensor_shape_proto::Dimension {
            value: Some(tensor_shape_proto::dimension::Value::DimValue(n as i64)),
            ..Default::default()
        });
        let input = graph.input.iter_mut().filter(|input| input.name == "image");
        input.for_each(|input| set_shape(input, Some(TensorShapeProto { dim: fixed.to_vec() })));
        graph.output.iter_mut().for_each(|output| set_shape(output, None));
        graph.value_info.clear();
        Ok(Cow::Owned(proto.encode_to_vec()))
    }

    fn session(&self, model: &[u8]) -> Result<Session> {
        let failed = |e: &dyn fmt::Display| self.wrong(&e.to_string());
        let runtime = runtime()?;
        let mut builder = Session::builder(&runtime.environment)
            .map_err(|e| failed(&e))?
            .with_optimization_level(GraphOptimizationLevel::All)
            .map_err(|e| failed(&e))?;
        if runtime.native {
            builder = builder.with_intra_threads(1).map_err(|e| failed(&e))?;
            let mut asked = Vec::new();
            for name in &self.providers.0 {
                let provider = Providers::dispatch(name).ok_or_else(|| {
                    Error::Detector(format!(
                        "execution provider '{name}': must be one of {}",
                        Providers::NAMES.join(", ")
                    ))
                })?;
                asked.push(provider.error_on_failure());
            }
            builder = builder.with_execution_providers(asked).map_err(|e| {
                Error::Detector(format!(
                    "execution provider {}: {e}; this ONNX Runtime may be built without it",
                    self.providers.0.join(", ")
                ))
            })?;
        }
        builder.commit_from_memory(model).map_err(|e| failed(&e))
    }

    fn wrong(&self, message: &str) -> Error {
        Error::Detector(format!("{}: {message}", self.file))
    }
}

fn set_shape(value: &mut ValueInfoProto, shape: Option<TensorShapeProto>) {
    if let Some(type_proto::Value::TensorType(tensor)) =
        value.r#type.as_mut().and_then(|of| of.value.as_mut())
    {
        tensor.shape = shape;
    }
}
