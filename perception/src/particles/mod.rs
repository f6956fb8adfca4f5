//! What all particle filters share: scored poses, their summary as a posterior, and the trace of a search.

mod result;
mod summary;
mod trace;

pub(crate) use self::result::{ScoredPose, SearchResult, typed};
pub(crate) use self::summary::{believed, nothing, summarized};
pub(crate) use self::trace::{Trace, closed, replaced};
