//! What a search believed while it went on, for pictures of its convergence.

use std::time::Instant;

use nalgebra::Isometry3;

use super::result::typed;
use crate::posterior::{PosePosterior, TracePoint};

/// Takes down the answer after each iteration; costs nothing when it is off.
#[derive(Debug)]
pub(crate) struct Trace {
    began: Instant,
    on: bool,
    /// What the iterations that were finished found; scores of levels cannot be compared, so it stands until a whole
    /// restart does better.
    answer: Option<Isometry3<f32>>,
    points: Vec<TracePoint>,
}

impl Trace {
    /// Begins now.
    pub fn new(on: bool) -> Self {
        Self { began: Instant::now(), on, answer: None, points: Vec::new() }
    }

    /// After an iteration: the best of its hypotheses (`None` without any), and how many were weighed by now.
    pub fn iteration(&mut self, hypotheses: usize, candidate: Option<&Isometry3<f32>>) {
        if self.on
            && let Some(pose) = self.answer.as_ref().or(candidate)
        {
            let seconds = self.began.elapsed().as_secs_f64();
            self.points.push(TracePoint { hypotheses, seconds, best: typed(pose) });
        }
    }

    /// After an iteration whose result is the answer from now on.
    pub fn answer(&mut self, hypotheses: usize, pose: &Isometry3<f32>) {
        self.answer = Some(*pose);
        self.iteration(hypotheses, None);
    }

    /// All points, in order.
    pub fn take(&mut self) -> Vec<TracePoint> {
        std::mem::take(&mut self.points)
    }
}

/// The points of a search and of one that replaced it, of which nothing counts before its end. The first weighed
/// `hypotheses` and took `seconds`.
pub(crate) fn replaced(
    mut first: Vec<TracePoint>,
    (hypotheses, seconds): (usize, f64),
    mut second: Vec<TracePoint>,
) -> Vec<TracePoint> {
    let answer = first.last().map(|point| point.best);
    let last = second.len().saturating_sub(1);
    for (i, point) in second.iter_mut().enumerate() {
        point.hypotheses += hypotheses;
        point.seconds += seconds;
        if i < last {
            point.best = answer.unwrap_or(point.best);
        }
    }
    first.append(&mut second);
    first
}

/// With a last point for what was decided after the object's own search: by the other objects and by colour.
pub(crate) fn closed(mut belief: PosePosterior) -> PosePosterior {
    if !belief.trace.is_empty() {
        let PosePosterior { hypotheses, seconds, best, .. } = belief;
        belief.trace.push(TracePoint { hypotheses, seconds, best });
    }
    belief
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32) -> Isometry3<f32> {
        Isometry3::translation(x, 0.0, 1.0)
    }

    fn places(points: &[TracePoint]) -> Vec<(usize, f64)> {
        points.iter().map(|p| (p.hypotheses, p.best.iso().translation.x)).collect()
    }

    #[test]
    fn an_answer_stands_until_a_better_one_and_off_is_empty() {
        let run = |on| {
            let mut trace = Trace::new(on);
            trace.iteration(10, Some(&at(3.0)));
            trace.iteration(15, None);
            trace.answer(20, &at(1.0));
            trace.iteration(30, Some(&at(2.0)));
            trace.answer(40, &at(0.0));
            trace.take()
        };
        assert_eq!(places(&run(true)), [(10, 3.0), (20, 1.0), (30, 1.0), (40, 0.0)]);
        assert!(run(true).is_sorted_by(|a, b| a.seconds <= b.seconds));
        assert!(run(false).is_empty());
    }

    #[test]
    fn a_second_search_counts_when_it_ends() {
        let points = |xs: &[f32]| {
            let mut trace = Trace::new(true);
            for (i, x) in xs.iter().enumerate() {
                trace.iteration(10 * (i + 1), Some(&at(*x)));
            }
            trace.take()
        };
        let both = replaced(points(&[5.0, 4.0]), (20, 2.0), points(&[9.0, 8.0, 1.0]));
        assert_eq!(places(&both), [(10, 5.0), (20, 4.0), (30, 4.0), (40, 4.0), (50, 1.0)]);
        assert!(both[1].seconds < 1.0 && both[2].seconds >= 2.0);
    }
}
