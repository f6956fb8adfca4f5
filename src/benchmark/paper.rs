//! The GRIP paper's table for anyone's estimates: the same objects, views, metrics and threshold, beside its own figures.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Result;
use grip_perception::metrics::auc;
use schemars::JsonSchema;
use serde::Serialize;

use super::case::{Case, bootstrap};
use super::evaluation::Evaluation;
use super::published::{GROUPS, OBJECTS, PaperObject, SOURCE, THRESHOLD_M};

/// Areas under the accuracy-threshold curve by the paper's protocol.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PaperTable {
    /// Where `published` is from.
    pub source: &'static str,
    /// Upper end of the curve, metres.
    pub threshold_m: f64,
    /// Base, varied lighting, occlusions.
    pub groups: Vec<Group>,
}

/// The figures of one group of views.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Group {
    /// As the paper calls it.
    pub name: &'static str,
    /// Its views.
    pub views: &'static [&'static str],
    /// The paper's 15 objects in its order.
    pub objects: Vec<Row>,
    /// Plain mean over the objects that have instances.
    pub overall: Overall,
}

/// One object.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Row {
    /// YCB name.
    pub object: &'static str,
    /// Its number in the data set.
    pub obj_id: u32,
    /// The error that the paper takes for it: `ADD-S` or `ADD`.
    pub metric: &'static str,
    /// Its figures.
    #[serde(flatten)]
    pub area: Area,
}

/// The mean over objects.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Overall {
    /// Objects with instances; the published means are over the same ones.
    pub objects: usize,
    /// The figures.
    #[serde(flatten)]
    pub area: Area,
}

/// An area, ours and the published ones, 0 to 1.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Area {
    /// Instances that were asked for.
    pub instances: usize,
    /// The area; null without instances.
    pub auc: Option<f64>,
    /// Its 95 % bootstrap interval.
    pub interval: Option<[f64; 2]>,
    /// Those of DOPE, PoseCNN+ICP and GRIP; null where the paper has none.
    pub published: [Option<f64>; 3],
}

impl PaperTable {
    /// Of the estimates of a data set at `root`.
    ///
    /// # Errors
    /// When the set lacks one of the paper's views, or has none of its objects.
    pub fn new(evaluation: &Evaluation, root: &Path) -> Result<Self> {
        let views: BTreeSet<&str> = evaluation.views.values().map(String::as_str).collect();
        let missing: Vec<&str> =
            GROUPS.iter().flat_map(|(_, names)| *names).copied().filter(|v| !views.contains(v)).collect();
        anyhow::ensure!(
            missing.is_empty(),
            "{}: the paper's table needs the views B, D, D1, D2, O1, O2 and O3, named in scene_info.json as grip scenes \
             writes it; missing: {}",
            root.display(),
            missing.join(", ")
        );
        let ids: BTreeSet<u32> = evaluation.cases.iter().map(|case| case.obj_id).collect();
        anyhow::ensure!(
            OBJECTS.iter().any(|object| ids.contains(&object.obj_id)),
            "{}: has none of the paper's objects, which are numbers {} of YCB-Video in BOP; it has {}",
            root.display(),
            list(OBJECTS.iter().map(|object| object.obj_id)),
            list(ids)
        );
        let group = |(index, &(name, views)): (usize, &(&'static str, &'static [&'static str]))| {
            let inside = |case: &&Case| {
                let view = evaluation.views.get(&(case.scene_id, case.im_id));
                view.is_some_and(|view| views.contains(&view.as_str()))
            };
            let cases: Vec<Case> = evaluation.cases.iter().filter(inside).copied().collect();
            Group::new(name, views, index, &cases)
        };
        let groups = GROUPS.iter().enumerate().map(group).collect();
        Ok(Self { source: SOURCE, threshold_m: THRESHOLD_M, groups })
    }
}

impl Group {
    /// Of the cases in its views; `index` is its column in the published figures.
    fn new(name: &'static str, views: &'static [&'static str], index: usize, cases: &[Case]) -> Self {
        let error = |object: &PaperObject, case: &Case| if object.symmetric { case.adds } else { case.add };
        let mut objects = Vec::new();
        let mut present: Vec<&PaperObject> = Vec::new();
        for object in &OBJECTS {
            let cases: Vec<Case> = cases.iter().filter(|c| c.obj_id == object.obj_id).copied().collect();
            let area = |errors: &[f64]| auc(errors, THRESHOLD_M);
            let errors: Vec<f64> = cases.iter().map(|case| error(object, case)).collect();
            let some = !cases.is_empty();
            if some {
                present.push(object);
            }
            objects.push(Row {
                object: object.name,
                obj_id: object.obj_id,
                metric: if object.symmetric { "ADD-S" } else { "ADD" },
                area: Area {
                    instances: cases.len(),
                    auc: some.then(|| area(&errors)),
                    interval: bootstrap(&cases, |case| error(object, case), area),
                    published: object.auc[index].map(number),
                },
            });
        }
        let cases: Vec<Case> =
            cases.iter().filter(|case| present.iter().any(|o| o.obj_id == case.obj_id)).copied().collect();
        let labelled = |case: &Case| {
            let object = present.iter().find(|object| object.obj_id == case.obj_id);
            (case.obj_id, object.map_or(f64::INFINITY, |object| error(object, case)))
        };
        let values: Vec<(u32, f64)> = cases.iter().map(labelled).collect();
        let some = !present.is_empty();
        // NaN, where a method has no figure for one of the objects, makes its mean one too.
        let mean = |method: usize| {
            present.iter().map(|object| object.auc[index][method]).sum::<f64>() / present.len() as f64
        };
        let overall = Overall {
            objects: present.len(),
            area: Area {
                instances: cases.len(),
                auc: some.then(|| mean_area(&values)),
                interval: bootstrap(&cases, labelled, mean_area),
                published: [0, 1, 2].map(|method| number(mean(method))),
            },
        };
        Self { name, views, objects, overall }
    }
}

/// The plain mean of the objects' areas; `values` are objects and errors. A draw of the bootstrap that misses an object is
/// a mean over the others.
fn mean_area(values: &[(u32, f64)]) -> f64 {
    let mut by_object: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for (object, error) in values {
        by_object.entry(*object).or_default().push(*error);
    }
    by_object.values().map(|errors| auc(errors, THRESHOLD_M)).sum::<f64>() / by_object.len().max(1) as f64
}

fn number(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

fn list(ids: impl IntoIterator<Item = u32>) -> String {
    ids.into_iter().map(|id| id.to_string()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_count_the_same_however_many_instances_they_have() {
        // Three exact ones of one object, one of another at half the threshold: (1 + 0.5) / 2, not 3.5 / 4.
        let values = [(4, 0.0), (4, 0.0), (4, 0.0), (11, 0.02)];
        assert!((mean_area(&values) - 0.75).abs() < 1e-12);
    }
}
