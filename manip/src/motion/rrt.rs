//! RRT-Connect (Kuffner and LaValle 2000) in the joint space of a group, and shortcutting of its paths.
//!
//! The planner knows nothing about robots: it gets a [`JointSpace`] and two predicates. What it returns is data: a
//! status, what it cost and, when solved, a path whose joints that wrap are unwrapped from the start on.

use std::time::Instant;

use rand::{Rng, RngExt};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::joint_space::JointSpace;
use crate::ranges::Ranges;

/// What may be asked of a configuration and of the straight motion between two.
pub trait Validity {
    /// The configuration is free.
    fn free(&self, q: &[f64]) -> bool;
    /// Every configuration on the straight way from `a` to `b` is free; `a` is known to be.
    fn motion_free(&self, a: &[f64], b: &[f64]) -> bool;
}

/// Settings of [`rrt_connect`] and [`shortcut`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RrtSettings {
    /// Longest edge, metres of [`JointSpace::distance`], 0.01 to 10. Default 1.0: some five edges across the work space.
    pub step: f64,
    /// Edge that is tried where that is blocked, metres, 0.001 to 10. Default 0.25.
    pub short_step: f64,
    /// Give up after this many extensions, 1 to 10 000 000. Default 1500: what is found at all is found by then, as a rule.
    pub max_iterations: usize,
    /// Shortcut attempts on a path that was found, 0 to 100 000. Default 60.
    pub shortcuts: usize,
}

impl Default for RrtSettings {
    fn default() -> Self {
        Self { step: 1.0, short_step: 0.25, max_iterations: 1500, shortcuts: 60 }
    }
}

impl RrtSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("step", self.step, 0.01..=10.0, "metres")
            .number("short_step", self.short_step, 0.001..=10.0, "metres")
            .count("max_iterations", self.max_iterations, 1..=10_000_000)
            .count("shortcuts", self.shortcuts, 0..=100_000)
            .result()
    }
}

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub enum SearchStatus {
    /// A path was found.
    Solved,
    /// The start is not free or outside the limits.
    InvalidStart,
    /// No goal is free and within the limits.
    InvalidGoal,
    /// The iterations ran out.
    Exhausted,
}

/// The outcome of a search.
#[derive(Debug, Clone)]
pub struct PathSearch {
    /// How it ended.
    pub status: SearchStatus,
    /// Extensions made; 0 when the straight way was free.
    pub iterations: usize,
    /// Nodes of both trees.
    pub nodes: usize,
    /// Wall time, seconds; the only figure here that differs between runs.
    pub seconds: f64,
    /// Index of the goal reached.
    pub goal: usize,
    /// The configurations from start to goal; empty unless solved.
    pub path: Vec<Vec<f64>>,
}

struct Tree {
    nodes: Vec<Vec<f64>>,
    parents: Vec<usize>,
}

impl Tree {
    /// Each chain begins with a root, and what follows hangs on it in a row.
    fn rooted(chains: &[Vec<Vec<f64>>]) -> Self {
        let mut tree = Self { nodes: Vec::new(), parents: Vec::new() };
        for chain in chains {
            for (i, q) in chain.iter().enumerate() {
                let next = tree.nodes.len();
                tree.add(q.clone(), if i == 0 { next } else { next - 1 });
            }
        }
        tree
    }

    fn nearest(&self, space: &JointSpace, q: &[f64]) -> usize {
        let mut best = (f64::INFINITY, 0);
        for (i, node) in self.nodes.iter().enumerate() {
            let d = space.distance(node, q);
            if d < best.0 {
                best = (d, i);
            }
        }
        best.1
    }

    fn add(&mut self, q: Vec<f64>, parent: usize) -> usize {
        self.nodes.push(q);
        self.parents.push(parent);
        self.nodes.len() - 1
    }

    /// One edge from node `from` towards `to`, if it is free: the new node, and whether it is `to`.
    fn extend(
        &mut self,
        space: &JointSpace,
        validity: &impl Validity,
        from: usize,
        to: &[f64],
        settings: &RrtSettings,
    ) -> Option<(usize, bool)> {
        let distance = space.distance(&self.nodes[from], to);
        if distance < 1e-9 {
            return None;
        }
        // Out of a narrow place only short steps lead.
        for step in [settings.step, settings.short_step] {
            let q = space.interpolate(&self.nodes[from], to, (step / distance).min(1.0));
            if validity.motion_free(&self.nodes[from], &q) {
                return Some((self.add(q, from), step >= distance));
            }
        }
        None
    }

    /// From the node to its root.
    fn trace(&self, mut node: usize) -> Vec<Vec<f64>> {
        let mut path = vec![self.nodes[node].clone()];
        while self.parents[node] != node {
            node = self.parents[node];
            path.push(self.nodes[node].clone());
        }
        path
    }

    fn root(&self, mut node: usize) -> usize {
        while self.parents[node] != node {
            node = self.parents[node];
        }
        node
    }
}

/// Searches a path from a start to any of several goals.
///
/// Each is a chain of configurations: the start or goal itself, then, where they are known, those of a way out of its narrow
/// place, whose motions from one to the next are free.
pub fn rrt_connect(
    space: &JointSpace,
    validity: &impl Validity,
    start_chain: &[Vec<f64>],
    goals: &[Vec<Vec<f64>>],
    settings: &RrtSettings,
    rng: &mut impl Rng,
) -> PathSearch {
    let clock = Instant::now();
    let done = |status, iterations, nodes, goal, path| PathSearch {
        status,
        iterations,
        nodes,
        seconds: clock.elapsed().as_secs_f64(),
        goal,
        path,
    };
    let usable = |q: &[f64]| space.within_limits(q) && validity.free(q);
    let Some(start) = start_chain.first().filter(|start| usable(start)) else {
        return done(SearchStatus::InvalidStart, 0, 0, 0, Vec::new());
    };
    let (indices, chains): (Vec<usize>, Vec<Vec<Vec<f64>>>) = goals
        .iter()
        .enumerate()
        .filter(|(_, goal)| goal.first().is_some_and(|goal| usable(goal)))
        .map(|(i, goal)| (i, goal.clone()))
        .unzip();
    let roots: Vec<&Vec<f64>> = chains.iter().map(|chain| &chain[0]).collect();
    if roots.is_empty() {
        return done(SearchStatus::InvalidGoal, 0, 0, 0, Vec::new());
    }
    // Most motions over a table are free as the crow flies: the nearest goals first.
    let mut order: Vec<usize> = (0..roots.len()).collect();
    order.sort_by(|&a, &b| space.distance(start, roots[a]).total_cmp(&space.distance(start, roots[b])));
    for &i in order.iter().take(3) {
        if validity.motion_free(start, roots[i]) {
            let end = space.unwrap_near(start, roots[i]);
            return done(SearchStatus::Solved, 0, 2, indices[i], vec![start.to_vec(), end]);
        }
    }

    let mut trees = [Tree::rooted(&[start_chain.to_vec()]), Tree::rooted(&chains)];
    for iteration in 1..=settings.max_iterations {
        // The smaller tree `a` grows towards a random sample, tree `b` towards the new node of `a`.
        let a = usize::from(trees[1].nodes.len() < trees[0].nodes.len());
        let b = 1 - a;
        let sample = space.sample(rng);
        let near = trees[a].nearest(space, &sample);
        let Some((new, _)) = trees[a].extend(space, validity, near, &sample, settings) else {
            continue;
        };
        let target = trees[a].nodes[new].clone();
        let mut tip = trees[b].nearest(space, &target);
        while let Some((next, arrived)) = trees[b].extend(space, validity, tip, &target, settings) {
            tip = next;
            if arrived {
                let (from_start, from_goal) = if a == 0 { (new, tip) } else { (tip, new) };
                let mut path = trees[0].trace(from_start);
                path.reverse();
                path.extend(trees[1].trace(from_goal));
                for i in 1..path.len() {
                    path[i] = space.unwrap_near(&path[i - 1], &path[i]);
                }
                // Both trees hold the meeting point.
                path.dedup_by(|b, a| space.distance(a, b) < 1e-12);
                let nodes = trees[0].nodes.len() + trees[1].nodes.len();
                let root = trees[1].root(from_goal);
                let chain = trees[1].parents[..root].iter().enumerate().filter(|(i, p)| i == *p).count();
                let goal = indices[chain];
                return done(SearchStatus::Solved, iteration, nodes, goal, path);
            }
        }
    }
    let nodes = trees[0].nodes.len() + trees[1].nodes.len();
    done(SearchStatus::Exhausted, settings.max_iterations, nodes, 0, Vec::new())
}

/// Replaces stretches of a path by straight motions where those are free and shorter, and drops waypoints between
/// which the straight way is free.
pub fn shortcut(
    space: &JointSpace,
    validity: &impl Validity,
    path: &[Vec<f64>],
    settings: &RrtSettings,
    rng: &mut impl Rng,
) -> Vec<Vec<f64>> {
    let mut path = prune(space, validity, path);
    for _ in 0..settings.shortcuts {
        if path.len() < 3 {
            break;
        }
        let lengths: Vec<f64> = path.windows(2).map(|w| space.distance(&w[0], &w[1])).collect();
        let total: f64 = lengths.iter().sum();
        let (mut s, mut t) = (total * rng.random::<f64>(), total * rng.random::<f64>());
        if s > t {
            std::mem::swap(&mut s, &mut t);
        }
        let (i, a) = locate(space, &path, &lengths, s);
        let (j, b) = locate(space, &path, &lengths, t);
        if i == j {
            continue;
        }
        let old = t - s;
        if space.distance(&a, &b) > 0.99 * old || !validity.motion_free(&a, &b) {
            continue;
        }
        // Unwrapped copies stay consistent: a and b lie on the path, which is unwrapped as a whole, and a short
        // way round that differs from the path's own shifts everything after it by whole turns.
        let mut next: Vec<Vec<f64>> = path[..=i].to_vec();
        next.push(a);
        next.push(b);
        next.extend_from_slice(&path[j + 1..]);
        for k in 1..next.len() {
            next[k] = space.unwrap_near(&next[k - 1], &next[k]);
        }
        next.dedup_by(|b, a| space.distance(a, b) < 1e-9);
        path = next;
    }
    prune(space, validity, &path)
}

/// The segment and the configuration at arc length `s`.
fn locate(space: &JointSpace, path: &[Vec<f64>], lengths: &[f64], s: f64) -> (usize, Vec<f64>) {
    let mut rest = s;
    for (i, &length) in lengths.iter().enumerate() {
        if rest <= length || i + 1 == lengths.len() {
            let t = if length > 0.0 { (rest / length).clamp(0.0, 1.0) } else { 0.0 };
            return (i, space.interpolate(&path[i], &path[i + 1], t));
        }
        rest -= length;
    }
    (0, path[0].clone())
}

/// Greedy: from each kept waypoint on to the farthest one that can be reached straight.
fn prune(space: &JointSpace, validity: &impl Validity, path: &[Vec<f64>]) -> Vec<Vec<f64>> {
    if path.len() < 3 {
        return path.to_vec();
    }
    let mut kept = vec![path[0].clone()];
    let mut i = 0;
    while i + 1 < path.len() {
        let mut j = path.len() - 1;
        while j > i + 1 && !validity.motion_free(&path[i], &path[j]) {
            j -= 1;
        }
        let last = kept.len() - 1;
        kept.push(space.unwrap_near(&kept[last], &path[j]));
        i = j;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::super::joint_space::Axis;
    use super::*;
    use grip_sim::rng::stream;
    use proptest::prelude::*;

    /// A plane with a wall at x in (0.4, 0.6) that is open for y > 0.8 only.
    struct Wall;
    impl Validity for Wall {
        fn free(&self, q: &[f64]) -> bool {
            !(q[0] > 0.4 && q[0] < 0.6 && q[1] < 0.8)
        }
        fn motion_free(&self, a: &[f64], b: &[f64]) -> bool {
            lowest_in_the_gap(a, b) >= 0.8
        }
    }

    /// The least y of a straight motion where its x is within (0.4, 0.6), at one end of that stretch.
    fn lowest_in_the_gap(a: &[f64], b: &[f64]) -> f64 {
        let (low, high) = (a[0].min(b[0]).max(0.4), a[0].max(b[0]).min(0.6));
        let y = |x: f64| {
            if a[0] == b[0] { a[1].min(b[1]) } else { a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]) }
        };
        if low < high || (low == high && low > 0.4 && low < 0.6) {
            y(low).min(y(high))
        } else {
            f64::INFINITY
        }
    }

    fn plane() -> JointSpace {
        let axis = Axis { lower: 0.0, upper: 1.0, wraps: false, reach: 1.0 };
        JointSpace::new(vec![axis, axis])
    }

    fn solve(seed: u64) -> PathSearch {
        let settings = RrtSettings { step: 0.1, ..Default::default() };
        let mut rng = stream(seed, "rrt");
        let goals = [vec![vec![0.5, 0.1]], vec![vec![0.9, 0.1], vec![0.95, 0.15]]];
        let mut search = rrt_connect(&plane(), &Wall, &[vec![0.1, 0.1]], &goals, &settings, &mut rng);
        search.path = shortcut(&plane(), &Wall, &search.path, &settings, &mut rng);
        search
    }

    #[test]
    fn goes_round_a_wall_and_names_the_free_goal() {
        for seed in 0..20 {
            let search = solve(seed);
            assert_eq!(search.status, SearchStatus::Solved);
            assert_eq!(search.goal, 1, "goal 0 is inside the wall");
            assert_eq!(search.path[0], [0.1, 0.1]);
            assert_eq!(search.path[search.path.len() - 1], [0.9, 0.1]);
            for w in search.path.windows(2) {
                assert!(lowest_in_the_gap(&w[0], &w[1]) > 0.8 - 1e-9);
            }
            let length: f64 = search.path.windows(2).map(|w| plane().distance(&w[0], &w[1])).sum();
            // Taut string over (0.4, 0.8) and (0.6, 0.8): 1.723.
            assert!(length > 1.72 && length < 2.3, "length {length}");
        }
    }

    fn length(path: &[Vec<f64>]) -> f64 {
        path.windows(2).map(|w| plane().distance(&w[0], &w[1])).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_shortened_path_is_free_keeps_its_ends_and_is_never_longer(
            seed in any::<u64>(),
            shortcuts in 0..100usize,
            start in prop::collection::vec(0.0..0.4f64, 2),
            goal in prop::collection::vec(0.6..1.0f64, 2),
        ) {
            let settings = RrtSettings { step: 0.1, shortcuts, ..Default::default() };
            let mut rng = stream(seed, "shortcut");
            let (from, to) = ([start.clone()], [vec![goal.clone()]]);
            let found = rrt_connect(&plane(), &Wall, &from, &to, &settings, &mut rng);
            prop_assert_eq!(found.status, SearchStatus::Solved);
            let path = shortcut(&plane(), &Wall, &found.path, &settings, &mut rng);
            prop_assert!(length(&path) <= length(&found.path) + 1e-9);
            prop_assert!(path[0] == start && path[path.len() - 1] == goal);
            // To a rounding where it grazes the corner.
            prop_assert!(path.windows(2).all(|w| lowest_in_the_gap(&w[0], &w[1]) > 0.8 - 1e-9));
        }
    }

    #[test]
    fn same_seed_same_path() {
        assert_eq!(solve(3).path, solve(3).path);
        assert_ne!(solve(3).path, solve(4).path);
    }

    #[test]
    fn says_why_it_failed() {
        let settings = RrtSettings::default();
        let run = |start: [f64; 2], goal: [f64; 2]| {
            let mut rng = stream(0, "rrt");
            rrt_connect(&plane(), &Wall, &[start.to_vec()], &[vec![goal.to_vec()]], &settings, &mut rng)
                .status
        };
        assert_eq!(run([0.5, 0.1], [0.9, 0.1]), SearchStatus::InvalidStart);
        assert_eq!(run([0.1, 0.1], [0.5, 0.1]), SearchStatus::InvalidGoal);
        assert_eq!(run([f64::NAN, 0.1], [0.9, 0.1]), SearchStatus::InvalidStart);
    }
}
