//! The shaders, put together from the WGSL files beside this one.

pub(super) const SHADOW: &str = concat!(include_str!("instances.wgsl"), include_str!("shadow.wgsl"));
pub(super) const GEOMETRY: &str = concat!(include_str!("instances.wgsl"), include_str!("geometry.wgsl"));
pub(super) const PREPARE: &str =
    concat!(include_str!("picture.wgsl"), include_str!("frame.wgsl"), include_str!("prepare.wgsl"));
pub(super) const SHADE: &str =
    concat!(include_str!("picture.wgsl"), include_str!("frame.wgsl"), include_str!("shade.wgsl"));
pub(super) const SOFTEN: &str = concat!(include_str!("picture.wgsl"), include_str!("soften.wgsl"));
pub(super) const LIGHT: &str =
    concat!(include_str!("picture.wgsl"), include_str!("frame.wgsl"), include_str!("light.wgsl"));
pub(super) const SMOOTH: &str = concat!(include_str!("picture.wgsl"), include_str!("smooth.wgsl"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_valid() {
        for (name, source) in [
            ("shadow", SHADOW),
            ("geometry", GEOMETRY),
            ("prepare", PREPARE),
            ("shade", SHADE),
            ("soften", SOFTEN),
            ("light", LIGHT),
            ("smooth", SMOOTH),
        ] {
            let module = naga::front::wgsl::parse_str(source)
                .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
            naga::valid::Validator::new(
                naga::valid::ValidationFlags::all(),
                naga::valid::Capabilities::default(),
            )
            .validate(&module)
            .unwrap_or_else(|error| panic!("{name}: {error:?}"));
        }
    }
}
