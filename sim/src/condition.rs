//! Scripted conditions (`scenes/conditions/*.toml`): light, exposure and clutter as data.
