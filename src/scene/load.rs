//! OBJ and MTL in (stub to be replaced).
use super::Scene;
use crate::error::Result;
use std::path::Path;

/// Loads an OBJ file.
pub fn load_obj(_path: &Path, _root: &Path) -> Result<Scene> {
    Ok(Scene::default())
}
