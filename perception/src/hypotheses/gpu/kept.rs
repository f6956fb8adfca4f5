//! Levels and meshes on the device, uploaded once and found again by the identity of their `Arc`.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

/// What was made of shared items that do not change, as long as these live; beyond `most`, the oldest goes.
#[derive(Debug)]
pub(super) struct Kept<T, U> {
    /// A weak reference keeps the address from being used again.
    entries: VecDeque<(Weak<T>, U)>,
    most: usize,
}

impl<T, U: Clone> Kept<T, U> {
    pub fn new(most: usize) -> Self {
        Self { entries: VecDeque::new(), most }
    }

    /// What was made of `item`, made now if it was not before.
    pub fn get<E>(&mut self, item: &Arc<T>, make: impl FnOnce(&T) -> Result<U, E>) -> Result<U, E> {
        let address = Arc::as_ptr(item);
        if let Some((_, made)) = self.entries.iter().find(|(kept, _)| kept.as_ptr() == address) {
            return Ok(made.clone());
        }
        self.entries.retain(|(kept, _)| kept.strong_count() > 0);
        let made = make(item)?;
        if self.entries.len() >= self.most {
            self.entries.pop_front();
        }
        self.entries.push_back((Arc::downgrade(item), made.clone()));
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_uploaded_once_and_forgotten_when_nobody_holds_them() {
        let mut kept = Kept::new(2);
        let mut uploads = 0;
        let mut get = |kept: &mut Kept<u32, u32>, item: &Arc<u32>| {
            kept.get(item, |x| {
                uploads += 1;
                Ok::<_, ()>(*x)
            })
            .unwrap()
        };
        let (a, b, c) = (Arc::new(1), Arc::new(1), Arc::new(3));
        for _ in 0..3 {
            assert_eq!((get(&mut kept, &a), get(&mut kept, &b)), (1, 1));
        }
        assert_eq!(kept.entries.len(), 2);
        drop(b);
        assert_eq!(get(&mut kept, &c), 3);
        assert_eq!(get(&mut kept, &a), 1);
        // The third that is alive pushes the oldest out.
        let d = Arc::new(4);
        assert_eq!(get(&mut kept, &d), 4);
        assert_eq!(kept.entries.len(), 2);
        assert_eq!(get(&mut kept, &a), 1);
        assert_eq!(uploads, 5);
    }
}
