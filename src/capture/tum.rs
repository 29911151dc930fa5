//! `trajectory.tum` and `objects/<name>.tum`: poses of the camera and of the objects that move.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::text::read_text;
use crate::camera::Trajectory;
use crate::error::{Error, Result};
use crate::files::Limit;
use crate::scene::Scene;

/// Reads a TUM file. `epoch_ns` is the zero of the capture's clock.
///
/// # Errors
/// A missing file, and those of [`Trajectory::parse`].
pub(super) fn read_trajectory(path: &Path, epoch_ns: i64) -> Result<Trajectory> {
    let text = read_text(path, "the poses over time: lines of t tx ty tz qx qy qz qw", Limit::TABLE)?;
    Trajectory::parse(path, &text, epoch_ns)
}

/// Gives every object that has an `objects/<name>.tum` its trajectory; the others rest.
///
/// # Errors
/// A file that names no object of the scene (with the nearest name), one that has an object's name and another ending,
/// and those of [`read_trajectory`].
pub(super) fn bind_objects(root: &Path, epoch_ns: i64, scene: &mut Scene) -> Result<()> {
    for path in files(&root.join("objects"))? {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if path.extension().is_none_or(|e| e != "tum") {
            // Notes of the user's own are no matter.
            if scene.objects.iter().any(|o| o.name == name) {
                let found = format!("a file of the object `{name}` that is not read");
                return Err(Error::input(
                    &path,
                    None,
                    found,
                    format!("its poses in {name}.tum, or no such file"),
                ));
            }
            continue;
        }
        if !scene.objects.iter().any(|o| o.name == name) {
            let known = scene.objects.iter().map(|o| o.name.as_str());
            return Err(Error::unknown_name(&path, None, "object of scene.obj", &name, known));
        }
        let trajectory = Arc::new(read_trajectory(&path, epoch_ns)?);
        // Two `o` lines of one name are one thing.
        for object in scene.objects.iter_mut().filter(|o| o.name == name) {
            object.trajectory = Some(Arc::clone(&trajectory));
        }
    }
    Ok(())
}

/// The files of a folder, sorted, so that the first error does not depend on the file system. None if there is
/// no such folder.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(Error::io(folder, "list", e)),
    };
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.map_err(|e| Error::io(folder, "list", e))?.path());
    }
    paths.sort();
    Ok(paths)
}
