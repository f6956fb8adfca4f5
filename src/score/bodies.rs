//! Which body of the world an item is, where several are of a kind.
//!
//! Two cans are told apart by where they are, and by nothing else: the robot numbers them as it likes. So what it believes to
//! be an item is judged by the body of that kind that is nearest to it. Once carried to the bin it stays that body.

use grip_physics::World;
use grip_sim::pose::{Object, Pose, World as WorldFrame};

use crate::matching::{self, nearest_pairs};

/// The body of each item, and back.
#[derive(Debug, Clone)]
pub struct Bodies {
    of_item: Vec<usize>,
}

impl Bodies {
    /// Item `i` is body `i`.
    pub fn new(items: usize) -> Self {
        Self { of_item: (0..items).collect() }
    }

    /// The body of an item.
    pub fn of(&self, item: usize) -> usize {
        self.of_item[item]
    }

    /// The item that a body is.
    pub fn item(&self, body: usize) -> usize {
        self.of_item.iter().position(|&of| of == body).unwrap_or(body)
    }

    /// The first `items` items in the order of their bodies, the others as they are: their old numbers.
    pub fn order(&self, items: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.of_item.len()).collect();
        order[..items].sort_by_key(|&item| self.of(item));
        order
    }

    /// The same when the item of the new number `i` has the old number `order[i]`.
    #[must_use]
    pub fn reordered(&self, order: &[usize]) -> Self {
        Self { of_item: order.iter().map(|&item| self.of(item)).collect() }
    }

    /// Two items change bodies.
    pub fn swap(&mut self, item: usize, other: usize) {
        self.of_item.swap(item, other);
    }

    /// After a look: `believed` is where the robot thinks each item is, if it knows; those that `stay` keep their bodies.
    pub fn assign(
        &mut self,
        world: &World,
        believed: &[Option<Pose<WorldFrame, Object>>],
        stay: impl Fn(usize) -> bool,
    ) {
        let before = self.of_item.clone();
        let kind = |body: usize| &world.object(body).info.name;
        let distance = |item: usize, body: usize| {
            let (own, keeps) = (before[item], stay(item) || stay(self.item(body)));
            if kind(own) != kind(body) || (keeps && own != body) {
                return None;
            }
            // Of an item that nobody knows a place of any body will do, best its own.
            let unknown = matching::unknown(own == body);
            let far = |pose: &Pose<WorldFrame, Object>| {
                (pose.translation() - world.truth(body).translation()).norm()
            };
            Some(believed[item].as_ref().map_or(unknown, far))
        };
        for (item, body) in nearest_pairs(before.len(), before.len(), distance) {
            self.of_item[item] = body;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::tests::empty;

    #[test]
    fn an_item_is_the_nearest_body_of_its_kind_and_stays_it_once_carried() {
        let (setup, mut world) = empty();
        let at = |x: f64| Pose::from_xyz_rpy([x, 0.0, 0.75], [0.0; 3]);
        for (name, x) in [("005_tomato_soup_can", 0.5), ("004_sugar_box", 0.6), ("005_tomato_soup_can", 0.7)]
        {
            world.add_object(setup.library.load(name).unwrap(), &at(x)).unwrap();
        }
        let mut bodies = Bodies::new(3);
        // The robot takes the far can for the first one, and the sugar box to be where the near can is.
        bodies.assign(&world, &[Some(at(0.71)), Some(at(0.5)), None], |_| false);
        assert_eq!([0, 1, 2].map(|i| bodies.of(i)), [2, 1, 0]);
        assert_eq!([0, 1, 2].map(|b| bodies.item(b)), [2, 1, 0]);
        assert_eq!((bodies.order(3), bodies.order(2)), (vec![2, 1, 0], vec![1, 0, 2]));
        assert_eq!([0, 1, 2].map(|i| bodies.reordered(&[1, 0, 2]).of(i)), [1, 2, 0]);
        bodies.assign(&world, &[Some(at(0.51)), None, Some(at(0.7))], |item| item == 0);
        assert_eq!(bodies.of(0), 2);
        bodies.assign(&world, &[Some(at(0.51)), None, Some(at(0.7))], |_| false);
        assert_eq!([0, 1, 2].map(|i| bodies.of(i)), [0, 1, 2]);
        bodies.swap(0, 2);
        assert_eq!((bodies.of(0), bodies.item(0)), (2, 2));
    }
}
