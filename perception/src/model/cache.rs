//! Prepared objects, kept between calls.

use std::sync::{Arc, Mutex, PoisonError};

use grip_sim::objects::ObjectModel;
use rayon::prelude::*;

use super::prepared::Model;
use crate::error::Result;

/// More objects than a session has; beyond it the oldest goes.
const CACHE_SIZE: usize = 64;

/// An object, the numbers of triangles asked for, and what was made of it.
type Entry = (Arc<ObjectModel>, Vec<usize>, Arc<Model>);

/// Prepared models by object, so that a trial simplifies each mesh once.
#[derive(Debug, Default)]
pub(crate) struct ModelCache {
    entries: Mutex<Vec<Entry>>,
}

impl ModelCache {
    /// The prepared models of all `objects`, in their order.
    pub fn all(&self, objects: &[Arc<ObjectModel>], counts: &[usize]) -> Result<Vec<Arc<Model>>> {
        objects.par_iter().map(|object| self.get(object, counts)).collect()
    }

    /// The prepared model of `object`, made now if it was not before.
    fn get(&self, object: &Arc<ObjectModel>, counts: &[usize]) -> Result<Arc<Model>> {
        let lock = || self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let found =
            lock().iter().find(|(o, c, _)| Arc::ptr_eq(o, object) && c == counts).map(|(_, _, m)| m.clone());
        if let Some(model) = found {
            return Ok(model);
        }
        let model = Arc::new(Model::new(object, counts)?);
        let mut entries = lock();
        if entries.len() >= CACHE_SIZE {
            entries.remove(0);
        }
        entries.push((object.clone(), counts.to_vec(), model.clone()));
        Ok(model)
    }
}
