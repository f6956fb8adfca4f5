//! Why an attempt is no success, in a line with what was measured and what was allowed.

use crate::score::outcome::{ItemResult, Outcome};
use crate::settings::SuccessCriteria;

/// When it went wrong, as far as a picture can show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// When the fingers had closed.
    Grasp,
    /// At the end of the carry.
    Carry,
    /// At the end of the trial.
    End,
}

/// Why an item that the robot believed to have packed is not packed, and when that was to be seen; `None` if it is packed.
pub fn verdict(item: &ItemResult, bound: &SuccessCriteria) -> Option<(String, When)> {
    let m = &item.measures;
    // A bound as it was written, in millimetres.
    let mm = |metres: f64| (1e6 * metres).round() / 1e3;
    let grip = || {
        format!(
            "{:.1} N, dot product {:.2} (at least {} N, at most {})",
            m.pinch_n, m.pinch_dot, bound.finger_force_n, bound.opposing_dot
        )
    };
    let rose = || format!("rose {:.1} mm of {}, touching nothing", 1e3 * m.risen_m, mm(bound.lift_m));
    let held = || format!("held for {:.2} s of {} when the carry ended", m.clear_s, bound.hold_s);
    let slid = || {
        if m.slip_m > bound.slip_m {
            format!("slid {:.1} mm in the hand, {} allowed", 1e3 * m.slip_m, mm(bound.slip_m))
        } else {
            format!("turned {:.1} degrees in the hand, {} allowed", m.slip_deg, bound.slip_deg)
        }
    };
    let (why, when) = match item.outcome {
        Outcome::Packed => return None,
        Outcome::Missed => (grip(), When::Grasp),
        Outcome::SlippedOnLift => (rose(), When::Carry),
        Outcome::DroppedInTransit => (held(), When::Carry),
        Outcome::Slipped => (slid(), When::Carry),
        Outcome::NotUpright => {
            (format!("leans {:.1} degrees, {} allowed", m.tilt_deg, bound.tilt_deg), When::End)
        }
        Outcome::Dropped => {
            let why = format!(
                "fell {:.1} mm, {} allowed, at up to {:.2} m/s, {} allowed",
                1e3 * m.release_m,
                mm(bound.release_m),
                m.landing_m_s,
                bound.landing_m_s
            );
            (why, When::End)
        }
        Outcome::Harmed => {
            let why = format!(
                "took a blow of {:.2} N s, {:.2} are harmless",
                m.packed_impulse_n_s, item.harmless_impulse_n_s
            );
            (why, When::End)
        }
        Outcome::Disturbed => (format!("knocked out: {}", m.knocked_out), When::End),
        Outcome::NotGrasped if !item.clauses.opposing_contacts => (grip(), When::Grasp),
        Outcome::NotGrasped if !item.clauses.lifted_clear => (rose(), When::Carry),
        Outcome::NotGrasped if !item.clauses.held_after_carry => (held(), When::Carry),
        Outcome::NotGrasped => (slid(), When::Carry),
        Outcome::WrongObject => (item.reason.clone(), When::Grasp),
        Outcome::PlacedOutside => {
            let edge = 1e3 * m.below_edge_m;
            let place = if edge < 0.0 { "above" } else { "below" };
            let why = format!(
                "at the end {:.0} mm {place} the bin's edge, moved {:.1} mm",
                edge.abs(),
                1e3 * m.moved_m
            );
            (why, When::End)
        }
        _ => (item.reason.clone(), When::End),
    };
    // The robot's own reasons often begin with whose they are.
    let whose = format!("{}: ", item.name());
    Some((format!("{}: {}", item.outcome.words(), why.strip_prefix(&whose).unwrap_or(&why)), when))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::outcome::{Clauses, Measures, Stage};

    fn item(outcome: Outcome, clauses: Clauses, measures: Measures) -> ItemResult {
        ItemResult {
            object: "011_banana".into(),
            instance: 1,
            outcome,
            stage: Stage::Carry,
            reason: "the robot's own".into(),
            attempts: 1,
            add_m: None,
            adds_m: None,
            slip_m: None,
            peak_force_n: 0.0,
            peak_impulse_n_s: 0.0,
            harmless_impulse_n_s: 0.0,
            others_moved_m: 0.0,
            first_attempt: None,
            failed_attempts: Vec::new(),
            clauses,
            measures,
        }
    }

    #[test]
    fn a_verdict_names_what_was_measured_and_what_was_allowed() {
        let bound = SuccessCriteria::default();
        let measures = Measures { slip_m: 0.023, slip_deg: 33.0, risen_m: 0.012, ..Measures::default() };
        let of = |outcome, clauses| verdict(&item(outcome, clauses, measures), &bound);
        let (why, when) = of(Outcome::Slipped, Clauses::default()).unwrap();
        assert_eq!(
            (why.as_str(), when),
            ("slipped in the hand: slid 23.0 mm in the hand, 20 allowed", When::Carry)
        );
        let gripped = Clauses { opposing_contacts: true, ..Clauses::default() };
        let (why, _) = of(Outcome::NotGrasped, gripped).unwrap();
        assert!(why.contains("rose 12.0 mm of 30"), "{why}");
        let turned = Measures { slip_m: 0.003, ..measures };
        let (why, _) = verdict(&item(Outcome::Slipped, gripped, turned), &bound).unwrap();
        assert!(why.contains("turned 33.0 degrees in the hand, 20 allowed"), "{why}");
        assert_eq!(of(Outcome::Packed, gripped), None);
        assert_eq!(of(Outcome::NotAttempted, gripped).unwrap().1, When::End);
        let mut item = item(Outcome::NoGrasp, gripped, measures);
        item.reason = "011_banana: no grasp can be lifted straight".into();
        let (why, _) = verdict(&item, &bound).unwrap();
        assert_eq!(why, "no reachable grasp: no grasp can be lifted straight", "the title names it already");
    }
}
