//! Networks of others, tried where a panic can be caught.
//!
//! tract panics at some models that are wrong (an output that no node gives, for one), and ort at some of its messages (a node whose
//! name has a zero byte). Behind ort's C interface that would end the process: a model that is wrong must not get there.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use tract_onnx::prelude::*;

/// Reads and optimises a model as ort will, and runs it on a grey image if there is a width and height.
///
/// # Errors
/// Why tract cannot; the caller names the model.
pub(super) fn rehearse(model: &[u8], size: Option<[usize; 2]>) -> Result<(), String> {
    let tried = quietly(|| {
        let model = onnx().model_for_read(&mut &*model)?.into_optimized()?;
        if let Some([width, height]) = size {
            let image = Tensor::from_shape(&[1, 3, height, width], &vec![0.5f32; 3 * width * height])?;
            model.into_runnable()?.run(tvec!(image.into()))?;
        }
        TractResult::Ok(())
    });
    match tried {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(format!("{error:#}").replace('\0', "\\0")),
        Err(message) => Err(format!(
            "cannot be read by tract, which gave up with '{message}'; check it (onnx.checker), or set ORT_DYLIB_PATH"
        )),
    }
}

/// Runs `work`; the message of its panic, which is not printed.
fn quietly<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    thread_local!(static QUIET: Cell<bool> = const { Cell::new(false) });
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                before(info);
            }
        }));
    });
    QUIET.set(true);
    let result = panic::catch_unwind(AssertUnwindSafe(work));
    QUIET.set(false);
    result.map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_message_and_what_comes_after_is_as_before() {
        assert_eq!(quietly(|| 3), Ok(3));
        assert_eq!(quietly(|| panic!("no {}", "entry")), Err::<(), _>("no entry".into()));
        assert_eq!(quietly(|| panic!("plain")), Err::<(), _>("plain".into()));
        assert_eq!(quietly(|| 4), Ok(4));
    }

    #[test]
    fn a_model_that_makes_tract_panic_is_an_error() {
        use prost::Message;
        use tract_onnx::pb::{GraphProto, ModelProto, ValueInfoProto};
        // An output that no node gives.
        let output = ValueInfoProto { name: "classes".into(), ..Default::default() };
        let graph = GraphProto { output: vec![output], ..Default::default() };
        let model = ModelProto { graph: Some(graph), ir_version: 8, ..Default::default() };
        let error = rehearse(&model.encode_to_vec(), None).unwrap_err();
        assert!(error.contains("tract") && error.contains("onnx.checker"), "{error}");
        assert!(!rehearse(b"no model", None).unwrap_err().is_empty());
    }
}
