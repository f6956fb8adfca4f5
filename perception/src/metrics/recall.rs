//! From errors to the average recall of the BOP challenge (since 2019): estimates are matched with instances for each metric
//! and threshold of its own.

use schemars::JsonSchema;
use serde::Serialize;

/// Thresholds of correctness and tolerances of VSD, each as a share of something: of the diameter for MSSD and for VSD's
/// tolerances, of 1 for VSD itself, of 100 pixels in an image of 640 columns for MSPD.
pub const THRESHOLDS: [f64; 10] = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5];
/// Thresholds of MSPD are shares of so many pixels in an image of [`MSPD_WIDTH`]: 5 to 50.
const MSPD_WHOLE_PX: f64 = 100.0;
/// Wider images have proportionally larger thresholds of MSPD.
const MSPD_WIDTH: f64 = 640.0;

/// Errors of one estimate against one instance. Infinite where there is no estimate, NaN where a metric cannot be measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairErrors {
    /// Metres.
    pub mssd_m: f64,
    /// Pixels of the image.
    pub mspd_px: f64,
    /// At the tolerances of [`THRESHOLDS`] times the diameter, 0 to 1.
    pub vsd: [f64; 10],
}

impl PairErrors {
    /// Of an instance without estimate.
    pub const MISSED: Self = Self { mssd_m: f64::INFINITY, mspd_px: f64::INFINITY, vsd: [f64::INFINITY; 10] };

    /// Mean over the tolerances; no number where VSD cannot be measured.
    pub fn mean_vsd(&self) -> f64 {
        self.vsd.iter().sum::<f64>() / self.vsd.len() as f64
    }
}

/// What errors of an object in an image are measured by, and which ones can be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Of the object, metres.
    pub diameter_m: f64,
    /// Columns of the image; `None` where they are not known, so that MSPD has no thresholds.
    pub width: Option<usize>,
    /// Whether there is a depth image, without which there is no VSD.
    pub depth: bool,
}

/// How many instances are found, at each threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hits {
    /// Instances that were asked for.
    pub instances: usize,
    /// By threshold.
    pub mssd: [usize; 10],
    /// By threshold; `None` where not all could be measured.
    pub mspd: Option<[usize; 10]>,
    /// By tolerance, then by threshold; `None` where not all could be measured.
    pub vsd: Option<[[usize; 10]; 10]>,
}

impl Hits {
    /// Of the `instances` of an object in an image. `errors[e][i]` are of estimate `e`, the surest first and no more of them
    /// than instances, against instance `i`.
    pub fn new(errors: &[Vec<PairErrors>], instances: usize, measured: &Measured) -> Self {
        let count = |error: &dyn Fn(&PairErrors) -> f64| {
            THRESHOLDS.map(|threshold| found(errors, instances, error, threshold))
        };
        let diameter = measured.diameter_m;
        let mspd = |width: usize| {
            let whole = MSPD_WHOLE_PX * width as f64 / MSPD_WIDTH;
            count(&|pair| pair.mspd_px / whole)
        };
        Self {
            instances,
            mssd: count(&|pair| pair.mssd_m / diameter),
            mspd: measured.width.map(mspd),
            vsd: measured.depth.then(|| std::array::from_fn(|tolerance| count(&|pair| pair.vsd[tolerance]))),
        }
    }

    /// Of two objects or images together.
    #[must_use]
    pub fn and(mut self, other: &Self) -> Self {
        fn add(sum: &mut [usize; 10], more: &[usize; 10]) {
            sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        self.instances += other.instances;
        add(&mut self.mssd, &other.mssd);
        self.mspd = self.mspd.zip(other.mspd).map(|(mut sum, more)| {
            add(&mut sum, &more);
            sum
        });
        self.vsd = self.vsd.zip(other.vsd).map(|(mut sum, more)| {
            sum.iter_mut().zip(&more).for_each(|(sum, more)| add(sum, more));
            sum
        });
        self
    }

    /// What the instances add to the average recall of any set that they belong to: that recall is the sum of this over the
    /// sum of instances. `None` where a metric could not be measured.
    pub fn credit(&self) -> Option<f64> {
        let vsd: usize = self.vsd?.as_flattened().iter().sum();
        let [mssd, mspd] = [self.mssd, self.mspd?].map(|hits| hits.iter().sum::<usize>());
        Some((vsd as f64 / 100.0 + mssd as f64 / 10.0 + mspd as f64 / 10.0) / 3.0)
    }
}

/// How many instances have an estimate with an error under the threshold. In the order of their confidence, estimates take the
/// best instance that is left.
fn found(
    errors: &[Vec<PairErrors>],
    instances: usize,
    error: &dyn Fn(&PairErrors) -> f64,
    threshold: f64,
) -> usize {
    let mut open = vec![true; instances];
    let mut count = 0;
    for of_estimate in errors {
        let mut best = (threshold, None);
        for (instance, pair) in of_estimate.iter().enumerate().take(instances) {
            let error = error(pair);
            // NaN is under no threshold.
            if open[instance] && error < best.0 {
                best = (error, Some(instance));
            }
        }
        if let (_, Some(instance)) = best {
            open[instance] = false;
            count += 1;
        }
    }
    count
}

/// Average recall as in the BOP challenge, 0 to 1; null where a metric cannot be measured for all instances. 0 for no instances.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AverageRecall {
    /// Mean of the three that follow.
    pub ar: Option<f64>,
    /// Visible surface discrepancy: mean over tolerances and thresholds of the share of instances that are found.
    pub ar_vsd: Option<f64>,
    /// Maximum symmetry-aware surface distance: mean over the thresholds.
    pub ar_mssd: f64,
    /// Maximum symmetry-aware projection distance: mean over the thresholds.
    pub ar_mspd: Option<f64>,
    /// Shares of instances found, by threshold: 0.05 to 0.5, mean over the tolerances.
    pub recall_vsd: Option<[f64; 10]>,
    /// By threshold: 0.05 to 0.5 of the diameter.
    pub recall_mssd: [f64; 10],
    /// By threshold: 5 to 50 pixels of an image of 640 columns.
    pub recall_mspd: Option<[f64; 10]>,
}

impl AverageRecall {
    /// Of all instances together.
    pub fn new<'a>(hits: impl IntoIterator<Item = &'a Hits>) -> Self {
        let none = Hits { instances: 0, mssd: [0; 10], mspd: Some([0; 10]), vsd: Some([[0; 10]; 10]) };
        let all = hits.into_iter().fold(none, Hits::and);
        let share = |hits: f64| hits / all.instances.max(1) as f64;
        let shares = |hits: [usize; 10]| hits.map(|hits| share(hits as f64));
        let mean = |shares: &[f64; 10]| shares.iter().sum::<f64>() / 10.0;
        let recall_vsd = all.vsd.map(|hits| {
            std::array::from_fn(|i| share(hits.iter().map(|of_one| of_one[i]).sum::<usize>() as f64 / 10.0))
        });
        let recall_mssd = shares(all.mssd);
        let recall_mspd = all.mspd.map(shares);
        Self {
            ar: all.credit().map(share),
            ar_vsd: recall_vsd.as_ref().map(mean),
            ar_mssd: mean(&recall_mssd),
            ar_mspd: recall_mspd.as_ref().map(mean),
            recall_vsd,
            recall_mssd,
            recall_mspd,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURED: Measured = Measured { diameter_m: 0.2, width: Some(1280), depth: true };

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-12, "{a}, not {b}");
    }

    fn pair(mssd_m: f64, mspd_px: f64, vsd: f64) -> PairErrors {
        PairErrors { mssd_m, mspd_px, vsd: [vsd; 10] }
    }

    #[test]
    fn one_estimate_by_hand() {
        // MSSD 0.22 of the diameter: under 0.25 to 0.5, six of ten. MSPD 29 px of 1280, that is 14.5: under 15 to 50, eight.
        // VSD 0.41 at all tolerances: under 0.45 and 0.5, two.
        let recall = AverageRecall::new([&Hits::new(&[vec![pair(0.044, 29.0, 0.41)]], 1, &MEASURED)]);
        near(recall.ar_mssd, 0.6);
        near(recall.ar_mspd.unwrap(), 0.8);
        near(recall.ar_vsd.unwrap(), 0.2);
        near(recall.ar.unwrap(), 1.6 / 3.0);
        assert_eq!(recall.recall_mssd, [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
        // VSD by tolerance: wrong at the first three, right from there on.
        let mut some = pair(0.0, 0.0, 0.0);
        some.vsd[..3].fill(1.0);
        let recall = AverageRecall::new([&Hits::new(&[vec![some]], 1, &MEASURED)]);
        near(recall.ar_vsd.unwrap(), 0.7);
        near(recall.ar.unwrap(), 2.7 / 3.0);
        near(some.mean_vsd(), 0.3);
    }

    #[test]
    fn instances_without_estimate_and_errors_that_are_no_numbers_are_not_found() {
        let exact = Hits::new(&[vec![pair(0.0, 0.0, 0.0)]], 1, &MEASURED);
        let missed = Hits::new(&[], 1, &MEASURED);
        let odd = Hits::new(&[vec![pair(f64::NAN, f64::INFINITY, f64::NAN)]], 1, &MEASURED);
        let recall = AverageRecall::new([
            &exact,
            &missed,
            &odd,
            &Hits::new(&[vec![PairErrors::MISSED]], 1, &MEASURED),
        ]);
        near(recall.ar.unwrap(), 0.25);
        assert_eq!(AverageRecall::new([]).ar, Some(0.0));
        let credit: f64 = [exact, missed, odd].iter().map(|hits| hits.credit().unwrap()).sum();
        near(credit, 1.0);
    }

    #[test]
    fn what_cannot_be_measured_of_one_is_not_told_of_all() {
        let without = |measured: Measured| {
            let exact = [vec![pair(0.0, 0.0, 0.0)]];
            let (one, other) = (Hits::new(&exact, 1, &MEASURED), Hits::new(&exact, 1, &measured));
            AverageRecall::new([&one, &other, &one])
        };
        let no_depth = without(Measured { depth: false, ..MEASURED });
        assert_eq!((no_depth.ar, no_depth.ar_vsd, no_depth.recall_vsd), (None, None, None));
        assert_eq!((no_depth.ar_mssd, no_depth.ar_mspd), (1.0, Some(1.0)));
        let no_width = without(Measured { width: None, ..MEASURED });
        assert_eq!((no_width.ar, no_width.ar_vsd, no_width.ar_mspd), (None, Some(1.0), None));
    }

    #[test]
    fn each_instance_is_found_once_and_the_surest_estimate_chooses_first() {
        let table = |rows: &[&[f64]]| -> Vec<Vec<PairErrors>> {
            rows.iter().map(|row| row.iter().map(|&share| pair(0.2 * share, 0.0, 0.0)).collect()).collect()
        };
        let found = |rows: &[&[f64]]| Hits::new(&table(rows), 2, &MEASURED).mssd;
        // Both are nearest to the first instance; the second estimate must take the other one, at 0.32.
        assert_eq!(found(&[&[0.01, 0.9], &[0.02, 0.32]]), [1, 1, 1, 1, 1, 1, 2, 2, 2, 2]);
        // The surest takes its own best although that leaves nothing for the other.
        assert_eq!(found(&[&[0.11, 0.12], &[0.11, 0.9]]), [0, 0, 1, 1, 1, 1, 1, 1, 1, 1]);
        // Where the surest is out of reach, the other one has the instance: matching is anew at each threshold.
        assert_eq!(found(&[&[0.21, 0.9], &[0.06, 0.9]]), [0, 1, 1, 1, 1, 1, 1, 1, 1, 1]);
        // One estimate of two.
        assert_eq!(found(&[&[0.01, 0.01]]), [1; 10]);
        assert_eq!(found(&[&[0.05, 0.9]])[0], 0, "under the threshold, not at it");
    }
}
