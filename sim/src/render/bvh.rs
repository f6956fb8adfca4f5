//! A bounding volume hierarchy over boxes (binned surface area heuristic, Wald 2007) and its traversal by rays.

use nalgebra::{Point3, Vector3};

/// Candidate splits an axis.
const BINS: usize = 12;
/// A node this small is not split.
const LEAF_SIZE: usize = 4;
/// Depth that the traversal stack can hold; nodes this deep become leaves.
const MAX_DEPTH: usize = 48;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aabb {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Aabb {
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    pub fn of(points: impl IntoIterator<Item = Point3<f32>>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |b, p| b.union(&Self { min: p.coords.into(), max: p.coords.into() }))
    }

    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].min(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].max(other.max[i])),
        }
    }

    /// Grown by `margin` on all sides.
    pub fn loosened(&self, margin: f32) -> Self {
        Self { min: self.min.map(|v| v - margin), max: self.max.map(|v| v + margin) }
    }

    fn center(&self, axis: usize) -> f32 {
        0.5 * (self.min[axis] + self.max[axis])
    }

    fn half_area(&self) -> f32 {
        let d: [f32; 3] = std::array::from_fn(|i| (self.max[i] - self.min[i]).max(0.0));
        d[0] * d[1] + d[1] * d[2] + d[2] * d[0]
    }

    /// Where the ray enters, if it does so before `limit`.
    #[inline]
    fn enter(&self, ray: &Ray, limit: f32) -> Option<f32> {
        let mut near = ray.start;
        let mut far = limit;
        for i in 0..3 {
            let a = (self.min[i] - ray.origin[i]) * ray.inverse[i];
            let b = (self.max[i] - ray.origin[i]) * ray.inverse[i];
            // `min` and `max` drop a NaN (0 times infinity), which then bounds nothing.
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        // One part in a million for rounding, so that a ray never slips between touching boxes.
        (near <= far * 1.000_001).then_some(near)
    }
}

/// A ray `origin + t direction`; the direction needs no unit length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub origin: [f32; 3],
    pub direction: [f32; 3],
    inverse: [f32; 3],
    /// Smallest `t` of interest.
    pub start: f32,
}

impl Ray {
    pub fn new(origin: Point3<f32>, direction: Vector3<f32>, start: f32) -> Self {
        Self {
            origin: origin.coords.into(),
            direction: direction.into(),
            inverse: direction.map(|d| 1.0 / d).into(),
            start,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Aabb,
    /// First item of a leaf, or index of the left child; the right one follows it.
    first: u32,
    /// Items of a leaf; 0 for an inner node.
    count: u32,
}

/// The hierarchy. Items are named by their rank in [`Bvh::order`].
#[derive(Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    /// Index of the box at each rank.
    pub order: Vec<u32>,
}

impl Bvh {
    pub fn new(boxes: &[Aabb]) -> Self {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut nodes = vec![Node { bounds: bounds_of(boxes, &order), first: 0, count: boxes.len() as u32 }];
        let mut open = vec![(0_usize, 0_usize)];
        while let Some((index, depth)) = open.pop() {
            let Node { first, count, .. } = nodes[index];
            let (first, count) = (first as usize, count as usize);
            if count <= LEAF_SIZE || depth >= MAX_DEPTH {
                continue;
            }
            let items = &mut order[first..first + count];
            let Some(left) = partition(boxes, items) else {
                continue;
            };
            let (a, b) = items.split_at(left);
            let children = nodes.len();
            for (part, start) in [(a, first), (b, first + left)] {
                nodes.push(Node {
                    bounds: bounds_of(boxes, part),
                    first: start as u32,
                    count: part.len() as u32,
                });
            }
            nodes[index].first = children as u32;
            nodes[index].count = 0;
            open.push((children, depth + 1));
            open.push((children + 1, depth + 1));
        }
        Self { nodes, order }
    }

    /// Calls `visit(rank, limit)` for items whose boxes the ray enters before `limit`, nearest boxes first; it returns
    /// the new limit, or `None` to stop.
    #[inline]
    pub fn traverse(&self, ray: &Ray, limit: f32, mut visit: impl FnMut(usize, f32) -> Option<f32>) {
        let mut limit = limit;
        let mut stack = [(0_u32, 0.0_f32); MAX_DEPTH + 2];
        let mut top = 0;
        if self.order.is_empty() || self.nodes[0].bounds.enter(ray, limit).is_none() {
            return;
        }
        let mut current = 0_usize;
        loop {
            let node = &self.nodes[current];
            if node.count > 0 {
                for rank in node.first..node.first + node.count {
                    match visit(rank as usize, limit) {
                        Some(new) => limit = new,
                        None => return,
                    }
                }
            } else {
                let left = node.first as usize;
                let enter = |i: usize| self.nodes[i].bounds.enter(ray, limit);
                match (enter(left), enter(left + 1)) {
                    (Some(a), Some(b)) => {
                        let (near, far, t) = if a <= b { (left, left + 1, b) } else { (left + 1, left, a) };
                        stack[top] = (far as u32, t);
                        top += 1;
                        current = near;
                        continue;
                    }
                    (Some(_), None) => {
                        current = left;
                        continue;
                    }
                    (None, Some(_)) => {
                        current = left + 1;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let (next, t) = stack[top];
                if t <= limit {
                    current = next as usize;
                    break;
                }
            }
        }
    }
}

fn bounds_of(boxes: &[Aabb], items: &[u32]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |b, &i| b.union(&boxes[i as usize]))
}

/// Reorders `items` into two groups and returns the size of the first; `None` when a leaf is cheaper or all centres
/// coincide.
fn partition(boxes: &[Aabb], items: &mut [u32]) -> Option<usize> {
    let mut best: Option<(f32, usize, f32)> = None;
    for axis in 0..3 {
        let center = |i: u32| boxes[i as usize].center(axis);
        let low = items.iter().map(|&i| center(i)).fold(f32::INFINITY, f32::min);
        let high = items.iter().map(|&i| center(i)).fold(f32::NEG_INFINITY, f32::max);
        let scale = BINS as f32 / (high - low);
        if !(high > low && scale.is_finite()) {
            continue;
        }
        let mut bins = [(Aabb::EMPTY, 0_usize); BINS];
        for &i in items.iter() {
            let bin = (((center(i) - low) * scale) as usize).min(BINS - 1);
            bins[bin].0 = bins[bin].0.union(&boxes[i as usize]);
            bins[bin].1 += 1;
        }
        let mut right = [(Aabb::EMPTY, 0_usize); BINS + 1];
        for b in (0..BINS).rev() {
            right[b] = (right[b + 1].0.union(&bins[b].0), right[b + 1].1 + bins[b].1);
        }
        let mut left = (Aabb::EMPTY, 0_usize);
        for b in 1..BINS {
            left = (left.0.union(&bins[b - 1].0), left.1 + bins[b - 1].1);
            if left.1 == 0 || right[b].1 == 0 {
                continue;
            }
            let cost = left.0.half_area() * left.1 as f32 + right[b].0.half_area() * right[b].1 as f32;
            if best.is_none_or(|(lowest, ..)| cost < lowest) {
                best = Some((cost, axis, low + b as f32 / scale));
            }
        }
    }
    let (_, axis, threshold) = best?;
    let mut left = 0;
    for i in 0..items.len() {
        if boxes[items[i] as usize].center(axis) < threshold {
            items.swap(i, left);
            left += 1;
        }
    }
    // Rounding can put all on one side of the threshold; halves are as good then.
    Some(if left == 0 || left == items.len() { items.len() / 2 } else { left })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_every_box_that_a_ray_enters(
            centers in prop::collection::vec(prop::array::uniform3(-1.0_f32..1.0), 0..200),
            origin in prop::array::uniform3(-2.0_f32..2.0),
            target in prop::array::uniform3(-1.0_f32..1.0),
        ) {
            let boxes: Vec<Aabb> = centers
                .iter()
                .map(|c| Aabb { min: *c, max: *c }.loosened(0.05))
                .collect();
            let direction = Vector3::from(target) - Vector3::from(origin);
            let ray = Ray::new(Point3::from(origin), direction, 0.0);
            let bvh = Bvh::new(&boxes);
            let mut found = Vec::new();
            bvh.traverse(&ray, 10.0, |rank, limit| {
                let i = bvh.order[rank];
                if boxes[i as usize].enter(&ray, limit).is_some() {
                    found.push(i);
                }
                Some(limit)
            });
            found.sort_unstable();
            let expected: Vec<u32> = (0..boxes.len() as u32)
                .filter(|&i| boxes[i as usize].enter(&ray, 10.0).is_some())
                .collect();
            prop_assert_eq!(found, expected);
        }
    }
}
