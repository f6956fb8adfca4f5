//! What an object is struck with.

/// The normal impulses on an object in the last steps, and the largest blow among them.
#[derive(Debug, Clone)]
pub(crate) struct Blows {
    /// Newton seconds a step, three times as many steps as a blow lasts.
    recent: Vec<f64>,
    /// The place of the newest.
    newest: usize,
    largest: f64,
}

impl Blows {
    /// Of blows that last so many steps.
    pub fn new(steps: usize) -> Self {
        Self { recent: vec![0.0; 3 * steps], newest: 0, largest: 0.0 }
    }

    /// Begins a step.
    pub fn begin_step(&mut self) {
        self.newest = (self.newest + 1) % self.recent.len();
        self.recent[self.newest] = 0.0;
    }

    /// Adds to the impulse of this step, newton seconds.
    pub fn add(&mut self, impulse: f64) {
        self.recent[self.newest] += impulse;
        self.largest = self.largest.max(self.blow());
    }

    /// The largest blow, newton seconds.
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// From now on only what comes counts.
    pub fn forget_largest(&mut self) {
        self.largest = 0.0;
    }

    /// Impulse within a blow's time beyond that of as many steps before and after.
    fn blow(&self) -> f64 {
        let all = self.recent.len();
        let ago = |k: usize| self.recent[(self.newest + all - k) % all];
        let sum = |of: std::ops::Range<usize>| of.map(ago).sum::<f64>();
        sum(all / 3..2 * all / 3) - sum(0..all / 3).max(sum(2 * all / 3..all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blow_is_what_comes_and_goes() {
        let largest = |impulse: &dyn Fn(usize) -> f64| {
            let mut blows = Blows::new(5);
            for step in 0..100 {
                blows.begin_step();
                blows.add(impulse(step));
            }
            blows.largest()
        };
        let (rest, knock) = (0.3, |step: usize| f64::from(u8::from((50..53).contains(&step))));
        // Whatever it bears meanwhile, before, after, or from then on.
        assert!((largest(&knock) - 3.0).abs() < 1e-12);
        assert!((largest(&|step| rest + knock(step)) - 3.0).abs() < 1e-12);
        assert!((largest(&|step| if step < 50 { 0.0 } else { rest } + knock(step)) - 3.0).abs() < 1e-12);
        // Pressing harder, for good or for longer than a blow lasts, is none.
        assert!(largest(&|step| if step < 50 { rest } else { 3.0 }) < 1e-12);
        assert!(largest(&|step| 0.1 * step as f64) < 1e-12);
        assert!(largest(&|step| if (40..60).contains(&step) { 3.0 } else { rest }) < 1e-12);
    }
}
