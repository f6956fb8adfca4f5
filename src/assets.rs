//! Finding the files that ship with the program.

use std::path::{Path, PathBuf};

/// A file or folder of the project, such as `scenes/grocery.toml`: the one under the current folder where there is one,
/// else the one that is built into the program.
pub fn find(relative: &str) -> PathBuf {
    let here = Path::new(relative);
    if here.exists() { here.to_path_buf() } else { grip_sim::files::builtin_path(relative) }
}

/// A file that someone has named: itself, or where there is none the one of that name that is built into the program, such as
/// `scenes/shelf.toml`.
pub fn named(path: &Path) -> PathBuf {
    let inside = path.to_str().map(|relative| grip_sim::files::builtin_path(&relative.replace('\\', "/")));
    match inside {
        Some(inside) if !grip_sim::files::exists(path) && grip_sim::files::exists(&inside) => inside,
        _ => path.to_path_buf(),
    }
}
