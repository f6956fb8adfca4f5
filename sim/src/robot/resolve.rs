//! Where a mesh named in a URDF lies on disk.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::files;

/// Environment variable searched when no package paths are given, as ROS does.
pub(super) const ROS_PACKAGE_PATH: &str = "ROS_PACKAGE_PATH";

/// Turns `package://`, `file://` and relative names into paths.
pub(super) struct Resolver {
    urdf_folder: PathBuf,
    package_paths: Vec<PathBuf>,
}

impl Resolver {
    /// `environment` is the value of [`ROS_PACKAGE_PATH`], used when `package_paths` is empty.
    pub fn new(urdf: &Path, package_paths: &[PathBuf], environment: Option<OsString>) -> Self {
        let package_paths = if package_paths.is_empty() {
            environment.map(|paths| std::env::split_paths(&paths).collect()).unwrap_or_default()
        } else {
            package_paths.to_vec()
        };
        Self {
            urdf_folder: urdf
                .parent()
                .filter(|folder| !folder.as_os_str().is_empty())
                .unwrap_or(Path::new("."))
                .to_path_buf(),
            package_paths,
        }
    }

    /// The file that `name` means. It may not exist; a package must.
    pub fn resolve(&self, name: &str) -> Result<PathBuf, String> {
        if let Some(rest) = name.strip_prefix("package://") {
            let Some((package, inside)) = rest.split_once('/') else {
                return Err(format!("'{name}' names no file; expected package://PACKAGE/PATH"));
            };
            return match self.package(package) {
                Some(folder) => Ok(files::named(&folder, inside)),
                None => Err(format!(
                    "'{name}': package '{package}' not found; searched {}; give the folder of the package, or the one that contains it, as a package path or in {ROS_PACKAGE_PATH}",
                    self.searched()
                )),
            };
        }
        if let Some((scheme, _)) = name.split_once("://").filter(|(scheme, _)| *scheme != "file") {
            return Err(format!(
                "'{name}': scheme '{scheme}' is not supported; use package://, file:// or a path relative to the URDF"
            ));
        }
        Ok(files::named(&self.urdf_folder, name))
    }

    fn package(&self, package: &str) -> Option<PathBuf> {
        let given = self.package_paths.iter().find_map(|path| {
            let inside = path.join(package);
            if inside.is_dir() { Some(inside) } else { is_package(path, package).then(|| path.clone()) }
        });
        // A URDF usually lies in the package that it names.
        given.or_else(|| {
            let folder = std::path::absolute(&self.urdf_folder).ok()?;
            folder.ancestors().find(|above| is_package(above, package)).map(Path::to_path_buf)
        })
    }

    fn searched(&self) -> String {
        let mut places: Vec<String> =
            self.package_paths.iter().map(|path| path.display().to_string()).collect();
        places.push(format!("the folders above {}", self.urdf_folder.display()));
        places.join(", ")
    }
}

/// Whether a folder is the package: by its own name, or by the `<name>` in its `package.xml`.
fn is_package(folder: &Path, package: &str) -> bool {
    if folder.is_dir() && folder.file_name().is_some_and(|name| name == package) {
        return true;
    }
    let Ok(manifest) = std::fs::read_to_string(folder.join("package.xml")) else {
        return false;
    };
    manifest
        .split_once("<name>")
        .and_then(|(_, rest)| rest.split_once("</name>"))
        .is_some_and(|(name, _)| name.trim() == package)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_is_searched_only_when_no_paths_are_given() {
        let folder = tempfile::tempdir().unwrap();
        let package = folder.path().join("arm_description");
        std::fs::create_dir(&package).unwrap();
        let environment = std::env::join_paths(["/nowhere".into(), folder.path().to_path_buf()]);
        let environment = environment.ok();
        let urdf = Path::new("arm.urdf");
        let name = "package://arm_description/meshes/a.stl";
        let found = Resolver::new(urdf, &[], environment.clone()).resolve(name);
        assert_eq!(found, Ok(package.join("meshes/a.stl")));
        let given = [PathBuf::from("/elsewhere")];
        let error = Resolver::new(urdf, &given, environment).resolve(name);
        assert!(error.unwrap_err().contains("searched /elsewhere"));
    }
}
