//! On macOS a module of Python is linked against symbols that are found when it is loaded.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
