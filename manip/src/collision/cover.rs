//! Balls that cover a convex solid, for collision checks of many configurations at once.
//!
//! The solid's bounding box is halved again and again where the ball about what lies in a part sticks out farthest. The
//! balls cover the solid, so that whatever they keep clear of the solid keeps clear of; how far they stick out says how
//! often the solid itself has to be asked.

use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;

use super::solid::Solid;

/// A ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Centre, metres, in the owner's frame.
    pub center: Vector,
    /// Radius, metres.
    pub radius: f32,
}

impl Ball {
    /// The ball about these points, to a few thousandths of its radius the smallest (Badoiu and Clarkson 2003). None has
    /// radius zero about the origin.
    pub fn about(points: &[Vector]) -> Self {
        let n = points.len().max(1) as f32;
        let mut center = points.iter().fold(Vector::ZERO, |sum, p| sum + *p) / n;
        let farthest = |c: Vector| {
            points.iter().copied().max_by(|a, b| (*a - c).length().total_cmp(&(*b - c).length())).unwrap_or(c)
        };
        for i in 1..200 {
            center += (farthest(center) - center) / (i + 1) as f32;
        }
        Self { center, radius: (farthest(center) - center).length() }
    }

    /// A ball about balls.
    pub fn about_balls(balls: &[Self]) -> Self {
        let centers: Vec<Vector> = balls.iter().map(|b| b.center).collect();
        let center = Self::about(&centers).center;
        let radius = balls.iter().fold(0.0_f32, |r, b| r.max((b.center - center).length() + b.radius));
        Self { center, radius }
    }

    /// How far it sticks out of a convex solid, metres: measured in 200 directions, all round no more than 0.15 of the
    /// radius beyond that. Where a ball sticks out most is on its surface, as the distance from a convex solid is convex.
    pub(crate) fn error(&self, solid: &Solid) -> f32 {
        const DIRECTIONS: usize = 200;
        (0..DIRECTIONS)
            .map(|k| {
                // Fibonacci's lattice on the sphere.
                let z = 1.0 - (2.0 * k as f32 + 1.0) / DIRECTIONS as f32;
                let angle = k as f32 * std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
                let flat = (1.0 - z * z).sqrt();
                let out = Vector::new(flat * angle.cos(), flat * angle.sin(), z);
                super::solid::distance_from_point(solid, self.center + out * self.radius)
            })
            .fold(0.0, f32::max)
    }
}

/// Sides of the prism about a cylinder.
const SIDES: usize = 16;

/// At most `most` balls that cover `solid` (its own frame) and stick out at most `error` metres where that many can.
pub fn cover(solid: &Solid, error: f32, most: usize) -> Vec<Ball> {
    if let Solid::Ball(radius) = solid {
        return vec![Ball { center: Vector::ZERO, radius: *radius }];
    }
    let points = corners(solid);
    let facets: Vec<[Vector; 3]> = match try_convex_hull(&points) {
        Ok((points, facets)) => facets.iter().map(|f| f.map(|i| points[i as usize])).collect(),
        // A flat one: the ball about its points.
        Err(_) => return vec![Ball::about(&points)],
    };
    let part = |low: Vector, high: Vector| {
        let inside = clip(&facets, low, high);
        let ball = Ball::about(&inside);
        (!inside.is_empty()).then(|| Part { low, high, error: ball.error(solid), ball })
    };
    let low = points.iter().fold(Vector::splat(f32::INFINITY), |m, p| m.min(*p));
    let high = points.iter().fold(Vector::splat(f32::NEG_INFINITY), |m, p| m.max(*p));
    let mut parts: Vec<Part> = part(low, high).into_iter().collect();
    while parts.len() < most {
        let Some(worst) = (0..parts.len()).max_by(|&a, &b| parts[a].error.total_cmp(&parts[b].error)) else {
            break;
        };
        if parts[worst].error <= error {
            break;
        }
        let Part { low, high, .. } = parts.swap_remove(worst);
        // The halves whose worse one sticks out least.
        let halves = [0, 1, 2].map(|axis| {
            let (mut upper, mut lower) = (high, low);
            let middle = 0.5 * (low[axis] + high[axis]);
            (upper[axis], lower[axis]) = (middle, middle);
            [part(low, upper), part(lower, high)]
        });
        let worse = |pair: &[Option<Part>; 2]| pair.iter().flatten().fold(0.0, |m: f32, p| m.max(p.error));
        if let Some(best) = halves.into_iter().min_by(|a, b| worse(a).total_cmp(&worse(b))) {
            parts.extend(best.into_iter().flatten());
        }
    }
    parts.into_iter().map(|p| p.ball).collect()
}

/// What of the solid lies in a box.
struct Part {
    low: Vector,
    high: Vector,
    ball: Ball,
    error: f32,
}

/// Points whose hull is the solid, or a prism about it.
fn corners(solid: &Solid) -> Vec<Vector> {
    match solid {
        Solid::Cuboid(half) => (0..8)
            .map(|i| {
                let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
                *half * Vector::new(sign(0), sign(1), sign(2))
            })
            .collect(),
        Solid::Cylinder { half_height, radius } => {
            let step = std::f32::consts::TAU / SIDES as f32;
            let outer = radius / (0.5 * step).cos();
            (0..2 * SIDES)
                .map(|i| {
                    let angle = step * (i % SIDES) as f32;
                    let z = if i < SIDES { -half_height } else { *half_height };
                    Vector::new(outer * angle.cos(), outer * angle.sin(), z)
                })
                .collect()
        }
        Solid::Ball(_) => vec![Vector::ZERO],
        Solid::Points(points) => points.clone(),
    }
}

/// Points whose hull is what of a convex polyhedron lies in a box: of its facets what is inside, and the box's corners
/// inside of it.
fn clip(facets: &[[Vector; 3]], low: Vector, high: Vector) -> Vec<Vector> {
    let mut found = Vec::new();
    for facet in facets {
        let mut polygon = facet.to_vec();
        for axis in 0..3 {
            for (sign, bound) in [(1.0, high[axis]), (-1.0, -low[axis])] {
                let depth = |p: Vector| bound - sign * p[axis];
                let mut kept = Vec::with_capacity(polygon.len() + 1);
                for (i, &p) in polygon.iter().enumerate() {
                    let next = polygon[(i + 1) % polygon.len()];
                    let (a, b) = (depth(p), depth(next));
                    if a >= 0.0 {
                        kept.push(p);
                    }
                    if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                        kept.push(p + (next - p) * (a / (a - b)));
                    }
                }
                polygon = kept;
            }
        }
        found.extend(polygon);
    }
    let inside = |p: Vector| {
        facets.iter().all(|[a, b, c]| {
            let normal = (*b - *a).cross(*c - *a);
            normal.dot(p - *a) <= 1e-6 * normal.length()
        })
    };
    found.extend(
        (0..8)
            .map(|i| {
                let of = |bit: usize| if i >> bit & 1 == 0 { low[bit] } else { high[bit] };
                Vector::new(of(0), of(1), of(2))
            })
            .filter(|p| inside(*p)),
    );
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    fn solids() -> Vec<Solid> {
        let mut rng = grip_sim::rng::stream(1, "cover");
        let mut random = || 2.0 * rng.random::<f32>() - 1.0;
        let points = (0..30).map(|_| Vector::new(0.2 * random(), 0.1 * random(), 0.05 * random())).collect();
        vec![
            Solid::Cuboid(Vector::new(0.1, 0.15, 0.04)),
            Solid::Cylinder { half_height: 0.1, radius: 0.05 },
            Solid::Cylinder { half_height: 0.02, radius: 0.2 },
            Solid::Points(points),
            Solid::Ball(0.07),
        ]
    }

    #[test]
    fn every_point_of_the_solid_is_in_a_ball_and_more_balls_stick_out_less() {
        let mut rng = grip_sim::rng::stream(2, "cover");
        for solid in solids() {
            let mut last = f32::INFINITY;
            for most in [1, 4, 12, 40] {
                let balls = cover(&solid, 0.004, most);
                assert!(!balls.is_empty() && balls.len() <= most);
                let error = balls.iter().map(|b| b.error(&solid)).fold(0.0, f32::max);
                assert!(error <= last + 1e-4, "{error} with {most} balls, {last} with fewer");
                last = error;
                for _ in 0..2000 {
                    let p = Vector::new(1.0, 1.0, 1.0).map(|_| 0.25 * (2.0 * rng.random::<f32>() - 1.0));
                    if super::super::solid::distance_from_point(&solid, p) <= 0.0 {
                        let out = balls.iter().map(|b| (p - b.center).length() - b.radius);
                        assert!(out.fold(f32::INFINITY, f32::min) < 1e-5, "{solid:?}: {p} is outside");
                    }
                }
            }
        }
    }

    #[test]
    fn a_ball_about_a_cube_sticks_out_as_far_as_geometry_says() {
        let solid = Solid::Cuboid(Vector::splat(0.1));
        let ball = cover(&solid, 1.0, 1)[0];
        assert!((ball.radius - 0.1 * 3.0_f32.sqrt()).abs() < 1e-3, "{ball:?}");
        let error = ball.error(&solid);
        assert!((error - 0.1 * (3.0_f32.sqrt() - 1.0)).abs() < 2e-3, "{error}");
    }
}
