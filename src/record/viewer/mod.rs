//! The replay as a part of a page: one that can be turned, and scrubbed along time, without a network.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

const HTML: &str = include_str!("viewer.html");
const STYLE: &str = include_str!("viewer.css");
const SCRIPT: &str = include_str!("viewer.js");

/// An animated scene, as [`super::Recording::files`] has it, with its viewer.
pub fn html(glb: &[u8]) -> String {
    // Nothing in base64 ends a script.
    format!(
        "<style>{STYLE}</style>{HTML}<script type=\"application/octet-stream\" id=glb>{}</script><script>{SCRIPT}</script>",
        STANDARD.encode(glb)
    )
}
