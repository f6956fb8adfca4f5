//! Contact forces of the last step, by who touches whom.

use rapier3d::prelude::*;

use nalgebra::{Point3, Vector3};

use grip_sim::convert::from_vector;

/// What a collider belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// Table, bin, stand or floor: index of the fixture, or the floor behind the last one.
    Fixture(usize),
    /// An object, by its index in the world.
    Object(usize),
    /// A robot link that is not a finger, by its index in the robot model.
    Link(usize),
    /// 0 is the right finger, 1 the left one.
    Finger(usize),
}

impl Body {
    /// Packed into a collider's user data.
    pub(crate) fn tag(self) -> u128 {
        let (kind, index) = match self {
            Self::Fixture(i) => (0, i),
            Self::Object(i) => (1, i),
            Self::Link(i) => (2, i),
            Self::Finger(i) => (3, i),
        };
        (kind << 64) | index as u128
    }

    /// Read back from a collider's user data.
    pub(crate) fn from_tag(tag: u128) -> Self {
        let index = (tag & u128::from(u64::MAX)) as usize;
        match tag >> 64 {
            0 => Self::Fixture(index),
            1 => Self::Object(index),
            2 => Self::Link(index),
            _ => Self::Finger(index),
        }
    }
}

/// What one body, such as a finger, does to an object.
#[derive(Debug, Clone, Copy, Default)]
pub struct BodyContact {
    /// Normal force on the object, newtons, world frame.
    pub force: Vector3<f64>,
    /// Friction on the object, newtons, world frame.
    pub friction: Vector3<f64>,
    /// Sums over the contact points, weighted by their normal forces: newtons, newton metres, newton square metres.
    points: (f64, Vector3<f64>, f64),
}

impl BodyContact {
    /// Middle of the contact points, weighted by their normal forces, metres, world frame; none where nothing presses.
    pub fn middle(&self) -> Option<Point3<f64>> {
        let (weight, first, _) = self.points;
        (weight > 0.0).then(|| Point3::from(first / weight))
    }

    /// Root mean square distance of the contact points from their middle, metres.
    pub fn spread(&self) -> f64 {
        let (weight, first, second) = self.points;
        if weight > 0.0 { (second / weight - (first / weight).norm_squared()).max(0.0).sqrt() } else { 0.0 }
    }

    /// The same on the other body.
    fn reaction(self) -> Self {
        Self { force: -self.force, friction: -self.friction, ..self }
    }

    fn add(&mut self, other: &Self) {
        self.force += other.force;
        self.friction += other.friction;
        self.points.0 += other.points.0;
        self.points.1 += other.points.1;
        self.points.2 += other.points.2;
    }
}

/// The contacts of one object in the last step.
#[derive(Debug, Clone, Default)]
pub struct ObjectContacts {
    /// Right and left finger.
    pub fingers: [BodyContact; 2],
    /// Sum of the magnitudes of the normal forces by table, bin and other objects, newtons.
    pub support_force: f64,
    /// Largest normal force by any one body, newtons.
    pub largest_force: f64,
    /// Sum of the magnitudes of the normal forces by everything but the fingers, each body's as one, newtons.
    pub blow_force: f64,
    /// Objects that press this one down, and with how many newtons each.
    pub loads: Vec<(usize, f64)>,
    /// Objects that press on this one or that it presses on.
    pub objects: Vec<usize>,
    /// Fixtures it touches.
    pub fixtures: Vec<usize>,
    /// Whether a robot link other than a finger touches it.
    pub link: bool,
    /// What each body does, over all pieces of both.
    by_body: Vec<(Body, BodyContact)>,
}

impl ObjectContacts {
    /// Whether both fingers press with at least `newtons` each, the dot product of the unit forces at most `opposing_dot`.
    pub fn pinched(&self, newtons: f64, opposing_dot: f64) -> bool {
        let [right, left] = &self.fingers;
        let (a, b) = (right.force.norm(), left.force.norm());
        a >= newtons && b >= newtons && right.force.dot(&left.force) <= opposing_dot * a * b
    }

    /// Each body that touches it, and what that does to it.
    pub fn by_body(&self) -> &[(Body, BodyContact)] {
        &self.by_body
    }

    /// Whether the robot touches it at all.
    pub fn touched_by_robot(&self) -> bool {
        self.link || self.fingers.iter().any(|f| f.force.norm() > 0.0)
    }
}

/// All contact forces of the last step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Contacts {
    /// By object index.
    pub objects: Vec<ObjectContacts>,
    /// Net force on the two fingers by all but each other, newtons, world frame.
    pub on_hand: Vector3<f64>,
    /// Largest normal force on a single robot link that is not a finger, newtons, and that link.
    pub link_force: Option<(f64, usize)>,
}

/// What the first body of `pair`, whose collider is `first`, feels, from the impulses that the solver really applied; none where it
/// applied none.
///
/// `ContactPair::total_impulse` would count stale impulses of points that the solver did not see.
fn felt(pair: &ContactPair, first: &Collider, parameters: &IntegrationParameters) -> Option<BodyContact> {
    let dt = f64::from(parameters.dt);
    // Friction is kept as an impulse of the last substep, and in the same way at each point of a manifold.
    let substep = dt / parameters.num_solver_iterations as f64;
    let mut all = BodyContact::default();
    for manifold in pair.solver_manifolds() {
        let mut normal_impulse = 0.0;
        let mut friction = None;
        for contact in &manifold.data.solver_contacts {
            let point = (contact.contact_id[0] & !rapier3d::geometry::NEW_CONTACT_BIT) as usize;
            let Some(point) = manifold.points.get(point).filter(|point| point.data.impulse > 0.0) else {
                continue;
            };
            let impulse = f64::from(point.data.impulse);
            normal_impulse += impulse;
            friction = Some(from_vector(point.data.warmstart_tangent_world));
            let place = from_vector(first.position().transform_point(point.local_p1));
            all.add(&BodyContact {
                points: (impulse / dt, place * (impulse / dt), place.norm_squared() * (impulse / dt)),
                ..BodyContact::default()
            });
        }
        // The manifold's normal points from the first collider to the second; the first is pushed back.
        all.force -= from_vector(manifold.data.normal) * normal_impulse;
        all.friction += friction.unwrap_or_default() / substep;
    }
    all.force /= dt;
    (all.points.0 > 0.0).then_some(all)
}

impl Contacts {
    /// Reads the narrow phase after a step.
    pub fn read(physics: &PhysicsWorld, objects: usize) -> Self {
        let mut contacts = Self { objects: vec![ObjectContacts::default(); objects], ..Self::default() };
        let mut links: Vec<(usize, Vector3<f64>)> = Vec::new();
        for pair in physics.narrow_phase.contact_pairs() {
            let both = (physics.colliders.get(pair.collider1), physics.colliders.get(pair.collider2));
            let (Some(first), Some(second)) = both else { continue };
            let Some(on_first) = felt(pair, first, &physics.integration_parameters) else { continue };
            let [first, second] = [first, second].map(|collider| Body::from_tag(collider.user_data));
            for (me, other, on_me) in [(first, second, on_first), (second, first, on_first.reaction())] {
                let force = on_me.force;
                match me {
                    Body::Object(i) => contacts.objects[i].add(other, &on_me),
                    Body::Finger(_) if !matches!(other, Body::Finger(_)) => {
                        contacts.on_hand += force + on_me.friction;
                    }
                    Body::Link(link) => match links.iter_mut().find(|(l, _)| *l == link) {
                        Some((_, sum)) => *sum += force,
                        None => links.push((link, force)),
                    },
                    _ => {}
                }
            }
        }
        for object in &mut contacts.objects {
            object.sum_up();
        }
        contacts.link_force =
            links.into_iter().map(|(link, f)| (f.norm(), link)).max_by(|a, b| a.0.total_cmp(&b.0));
        contacts
    }
}

impl ObjectContacts {
    /// Adds what one piece of `other` does to one of the object's.
    fn add(&mut self, other: Body, contact: &BodyContact) {
        match self.by_body.iter_mut().find(|(body, _)| *body == other) {
            Some((_, sum)) => sum.add(contact),
            None => self.by_body.push((other, *contact)),
        }
        if let Body::Finger(side) = other {
            self.fingers[side].add(contact);
        }
    }

    /// What all bodies do together.
    fn sum_up(&mut self) {
        for &(body, BodyContact { force, .. }) in &self.by_body {
            let newtons = force.norm();
            self.largest_force = self.largest_force.max(newtons);
            if !matches!(body, Body::Finger(_)) {
                self.blow_force += newtons;
            }
            match body {
                Body::Finger(_) => {}
                Body::Link(_) => self.link = true,
                Body::Fixture(i) => {
                    self.support_force += newtons;
                    self.fixtures.push(i);
                }
                Body::Object(i) => {
                    self.support_force += newtons;
                    self.objects.push(i);
                    if force.z < 0.0 {
                        self.loads.push((i, -force.z));
                    }
                }
            }
        }
    }
}
