//! The rapier world: the only place that knows where things really are.
