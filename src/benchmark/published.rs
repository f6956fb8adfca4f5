//! What the GRIP paper reports, digit by digit: Chen et al., "GRIP: Generative Robust Inference and Perception for Semantic
//! Robot Manipulation in Adversarial Environments", IROS 2019, Table I.

/// Where the figures are from.
pub const SOURCE: &str = "Chen et al. 2019 (IROS), Table I";

/// Upper end of the accuracy-threshold curve, metres.
pub const THRESHOLD_M: f64 = 0.04;

/// The three settings, with the names of their views.
pub const GROUPS: [(&str, &[&str]); 3] =
    [("base", &["B"]), ("varied lighting", &["D", "D1", "D2"]), ("occlusions", &["O1", "O2", "O3"])];

/// The rivals, in the order of the columns.
pub const METHODS: [&str; 3] = ["DOPE", "PoseCNN+ICP", "GRIP"];

/// The objects of which the paper draws curves: DOPE knows them.
pub const DRAWN: [&str; 4] =
    ["003_cracker_box", "005_tomato_soup_can", "006_mustard_bottle", "010_potted_meat_can"];

/// One of the paper's objects.
#[derive(Debug)]
pub struct PaperObject {
    /// YCB name.
    pub name: &'static str,
    /// Number in BOP's YCB-Video, which is that of our own sets.
    pub obj_id: u32,
    /// Whether its error is ADD-S (an asterisk in the table) instead of ADD.
    pub symmetric: bool,
    /// AUC by group and method, 0 to 1; NaN where the paper has none.
    pub auc: [[f64; 3]; 3],
}

const ADD: bool = false;
const ADDS: bool = true;
/// DOPE is trained for some of the objects only.
const NONE: f64 = f64::NAN;

const fn object(name: &'static str, obj_id: u32, symmetric: bool, auc: [[f64; 3]; 3]) -> PaperObject {
    PaperObject { name, obj_id, symmetric, auc }
}

/// The rows of the table.
#[rustfmt::skip]
pub const OBJECTS: [PaperObject; 15] = [
    object("003_cracker_box", 2, ADDS, [[0.6384, 0.5925, 0.7878], [0.5509, 0.6225, 0.7923], [0.5703, 0.4850, 0.7442]]),
    object("005_tomato_soup_can", 4, ADDS, [[0.7691, 0.5535, 0.9015], [0.5326, 0.5181, 0.8104], [0.6372, 0.6013, 0.8347]]),
    object("006_mustard_bottle", 5, ADDS, [[0.5720, 0.4280, 0.8860], [0.6290, 0.6310, 0.8552], [0.7295, 0.5864, 0.8208]]),
    object("007_tuna_fish_can", 6, ADDS, [[NONE, 0.3763, 0.7670], [NONE, 0.3616, 0.7849], [NONE, 0.3915, 0.6220]]),
    object("010_potted_meat_can", 9, ADDS, [[0.5556, 0.6756, 0.8226], [0.4347, 0.5273, 0.5006], [0.5045, 0.5962, 0.6342]]),
    object("011_banana", 10, ADD, [[NONE, 0.3922, 0.5467], [NONE, 0.3449, 0.5591], [NONE, 0.2137, 0.2750]]),
    object("019_pitcher_base", 11, ADD, [[NONE, 0.2442, 0.1774], [NONE, 0.2490, 0.1659], [NONE, 0.3341, 0.1874]]),
    object("021_bleach_cleanser", 12, ADD, [[NONE, 0.3302, 0.5671], [NONE, 0.3111, 0.5523], [NONE, 0.2204, 0.4635]]),
    object("024_bowl", 13, ADDS, [[NONE, 0.3190, 0.8674], [NONE, 0.3397, 0.7109], [NONE, 0.2345, 0.6185]]),
    object("025_mug", 14, ADD, [[NONE, 0.3491, 0.2201], [NONE, 0.3176, 0.2170], [NONE, 0.2216, 0.2094]]),
    object("037_scissors", 17, ADD, [[NONE, 0.5450, 0.3192], [NONE, 0.5812, 0.1647], [NONE, 0.3548, 0.1783]]),
    object("040_large_marker", 18, ADDS, [[NONE, 0.2071, 0.7537], [NONE, 0.4094, 0.6750], [NONE, 0.2736, 0.6711]]),
    object("051_large_clamp", 19, ADD, [[NONE, 0.2405, 0.4927], [NONE, 0.2061, 0.1642], [NONE, 0.0645, 0.2551]]),
    object("052_extra_large_clamp", 20, ADD, [[NONE, 0.4000, 0.1742], [NONE, 0.1460, 0.1742], [NONE, 0.2147, 0.1441]]),
    object("061_foam_brick", 21, ADDS, [[NONE, 0.8094, 0.8333], [NONE, 0.6380, 0.8011], [NONE, 0.5419, 0.8297]]),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_add_up_to_the_papers_overall() {
        let overall = [[0.4308, 0.6078], [0.4136, 0.5285], [0.3556, 0.4992]];
        for (group, published) in overall.iter().enumerate() {
            for (method, published) in published.iter().enumerate() {
                let sum: f64 = OBJECTS.iter().map(|o| o.auc[group][method + 1]).sum();
                println!("{group} {method} {:.5} {published}", sum / 15.0);
                assert!((sum / 15.0 - published).abs() < 6e-5, "group {group}, method {method}");
            }
        }
    }

    #[test]
    fn numbers_are_those_of_ycb_video() {
        // BOP's order of the 21 objects.
        let order = [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 19, 21, 24, 25, 35, 36, 37, 40, 51, 52, 61];
        for object in &OBJECTS {
            let ycb: u32 = object.name[..3].parse().unwrap();
            assert_eq!(order[object.obj_id as usize - 1], ycb, "{}", object.name);
        }
        assert_eq!(OBJECTS.iter().filter(|o| o.symmetric).count(), 8);
    }
}
