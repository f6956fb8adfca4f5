//! MoveIt's `.scene` files: a planning scene's objects as text, as its RViz panel exports them.
//!
//! The scene's name; for each object `* NAME`, since 2020 its pose, the number of its shapes, each shape (kind, dimensions,
//! position, orientation x y z w, colour), since 2020 the number of its subframes and these; then `.`. Which of both a file is shows
//! in the line after the first name: a pose has several numbers, a count is one (moveit_core, planning_scene.cpp).

use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Vector3};

use super::pose;

/// Shapes of the file in its frame, and the names of their objects.
///
/// # Errors
/// Object, line, and what is not understood.
pub(super) fn parse(text: &str) -> Result<(Vec<CollisionShape>, Vec<String>), String> {
    let mut reader = Reader { lines: text.lines().enumerate().collect(), at: 0 };
    let begin = reader.lines.iter().position(|(_, line)| line.trim_start().starts_with('*'));
    let newer = begin
        .and_then(|begin| reader.lines.get(begin + 1))
        .is_some_and(|(_, line)| line.split_whitespace().count() > 1);
    // Before the first object there is the scene's name.
    let (mut shapes, mut names) = (Vec::new(), Vec::new());
    reader.at = begin.unwrap_or(usize::from(!reader.lines.is_empty()));
    loop {
        let line = reader.line("an object ('* NAME') or the end ('.')")?.trim();
        if line == "." {
            return Ok((shapes, names));
        }
        let name = line.strip_prefix('*').map(str::trim).ok_or_else(|| {
            reader.wrong(&format!("'{line}' is neither an object ('* NAME') nor the end ('.')"))
        })?;
        let (name, about) = (name.to_owned(), |message: String| format!("object '{name}': {message}"));
        let of_object = if newer { reader.pose().map_err(about)? } else { Isometry3::identity() };
        let [count] = reader.numbers().map_err(about)?;
        for _ in 0..counted(count).map_err(about)? {
            let geometry = reader.shape().map_err(about)?;
            let pose = of_object * reader.pose().map_err(about)?;
            // Its colour.
            reader.numbers::<4>().map_err(about)?;
            shapes.push(CollisionShape { pose, geometry });
            names.push(name.clone());
        }
        if newer {
            let [count] = reader.numbers().map_err(about)?;
            for _ in 0..counted(count).map_err(about)? {
                reader.line("the name of a subframe").map_err(about)?;
                reader.pose().map_err(about)?;
            }
        }
    }
}

fn counted(count: f64) -> Result<usize, String> {
    if count >= 0.0 && count.fract() == 0.0 && count < 1e6 {
        Ok(count as usize)
    } else {
        Err(format!("{count} is no number of shapes"))
    }
}

struct Reader<'a> {
    lines: Vec<(usize, &'a str)>,
    at: usize,
}

impl<'a> Reader<'a> {
    /// The next line that is not empty.
    fn line(&mut self, what: &str) -> Result<&'a str, String> {
        while let Some((_, line)) = self.lines.get(self.at) {
            self.at += 1;
            if !line.trim().is_empty() {
                return Ok(line);
            }
        }
        Err(format!("ends where {what} is expected; it may be cut off"))
    }

    fn wrong(&self, message: &str) -> String {
        format!("line {}: {message}", self.at)
    }

    /// The numbers of a line.
    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], String> {
        let line = self.line("a number")?;
        let numbers: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok()).collect();
        numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
            self.wrong(&format!("'{}' is not {N} number{}", line.trim(), if N == 1 { "" } else { "s" }))
        })
    }

    fn pose(&mut self) -> Result<Isometry3<f64>, String> {
        let (position, orientation) = (self.numbers()?, self.numbers()?);
        pose(position, orientation).map_err(|message| self.wrong(&message))
    }

    fn shape(&mut self) -> Result<Convex, String> {
        let kind = self.line("a shape")?.trim();
        let shape = match kind {
            "box" => Convex::Cuboid { half: Vector3::from(self.numbers::<3>()?) * 0.5 },
            "sphere" => Convex::Sphere { radius: self.numbers::<1>()?[0] },
            "cylinder" => {
                let [radius, length] = self.numbers()?;
                Convex::Cylinder { half_height: 0.5 * length, radius }
            }
            _ => return Err(self.wrong(&format!("shape '{kind}'; box, sphere and cylinder are read"))),
        };
        let sizes = match shape {
            Convex::Cuboid { half } => half.into(),
            Convex::Cylinder { half_height, radius } => [half_height, radius, radius],
            _ => [1.0; 3],
        };
        let good = |size: &f64| *size > 0.0 && *size < 1e3;
        if sizes.iter().all(good) && !matches!(shape, Convex::Sphere { radius } if !good(&radius)) {
            Ok(shape)
        } else {
            Err(self.wrong(&format!("the sizes of the {kind} are no lengths in metres")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OLD: &str = "(noname)+\n* shelf one\n2\nbox\n0.4 0.2 0.1\n0.8 0 0.5\n0 0 0.7071067811865476 0.7071067811865476\n\
                       0 0 0 0\ncylinder\n0.05 0.3\n0.8 0.1 0.7\n0 0 0 1\n1 0 0 1\n* ball\n1\nsphere\n0.1\n1 2 3\n0 0 0 1\n\
                       0 0 0 0\n.\n";
    const NEW: &str = "a scene\n* shelf one\n0.8 0 0.5\n0 0 0 1\n2\nbox\n0.4 0.2 0.1\n0 0 0\n\
                       0 0 0.7071067811865476 0.7071067811865476\n0 0 0 0\ncylinder\n0.05 0.3\n0 0.1 0.2\n0 0 0 1\n1 0 0 1\n1\n\
                       top\n0 0 0.1\n0 0 0 1\n* ball\n1 2 3\n0 0 0 1\n1\nsphere\n0.1\n0 0 0\n0 0 0 1\n0 0 0 0\n0\n.\n";

    #[test]
    fn the_same_scene_in_both_formats() {
        for text in [OLD, NEW] {
            let (shapes, names) = parse(text).unwrap();
            assert_eq!(names, ["shelf one", "shelf one", "ball"]);
            assert_eq!(shapes[0].geometry, Convex::Cuboid { half: Vector3::new(0.2, 0.1, 0.05) });
            assert_eq!(shapes[1].geometry, Convex::Cylinder { half_height: 0.15, radius: 0.05 });
            assert_eq!(shapes[2].geometry, Convex::Sphere { radius: 0.1 });
            let places = [[0.8, 0.0, 0.5], [0.8, 0.1, 0.7], [1.0, 2.0, 3.0]].map(Vector3::from);
            for (shape, place) in shapes.iter().zip(places) {
                assert!((shape.pose.translation.vector - place).norm() < 1e-12);
            }
            assert!((shapes[0].pose.rotation * Vector3::x() - Vector3::y()).norm() < 1e-9);
        }
        assert!(parse("empty\n.\n").unwrap().0.is_empty());
    }

    #[test]
    fn what_is_not_understood_is_named() {
        for (from, to, wanted) in [
            ("sphere", "cone", "object 'ball': line 16: shape 'cone'"),
            ("0.4 0.2 0.1", "0.4 0.2", "object 'shelf one': line 5: '0.4 0.2' is not 3 numbers"),
            ("0.4 0.2 0.1", "0.4 -0.2 0.1", "line 5: the sizes of the box"),
            ("\n2\n", "\n-2\n", "-2 is no number of shapes"),
            ("\n.\n", "\n", "cut off"),
            ("1 2 3\n0 0 0 1", "1 2 3\n0 0 0 9", "line 19"),
        ] {
            let error = parse(&OLD.replacen(from, to, 1)).unwrap_err();
            assert!(error.contains(wanted), "{wanted}: {error}");
        }
    }
}
