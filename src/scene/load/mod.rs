//! OBJ and MTL in. Files come from strangers: what can be read is read, with a warning for what is left out; everything
//! else is refused with an error that names file, line and what was expected.

mod library;
mod mtl;
mod normals;
mod obj;
mod paths;
mod text;
mod triangulate;

use std::path::Path;

use self::library::Library;
use self::normals::{Smooth, positions};
use self::obj::{Face, Geometry};
use self::paths::Root;
use self::text::read_text;
use self::triangulate::{Outcome, newell, triangulate};
use super::assemble::Assembler;
use super::{Object, Scene, Vertex};
use crate::error::{Error, Result, counted};
use crate::files::Limit;

/// Loads the OBJ file `path` with the materials and textures it names; none of the files may lie outside the folder
/// `root`. Shading is unlit and no object has a trajectory: both are the caller's to set.
///
/// Units, axes and winding are those of the file. In detail:
/// * Objects are the names of `o` (faces before the first belong to `""`); the same name twice is one object, and `g`
///   splits nothing.
/// * Polygons become triangles in their own plane: a fan if convex, else by ear clipping. Faces without area are left
///   out, and so are points, lines and free-form curves, each with a warning that counts them.
/// * Normals are those of the file (made unit). Where a corner has none they are computed: flat, or averaged by area
///   over the faces of its smoothing group where `s` names one. Missing texture coordinates are 0. Weights and colours
///   behind the three coordinates of `v` are ignored.
/// * `Kd` and `Ks` are linear. Without `Kd` a material is grey 0.8, or white under its texture; `Ks` defaults to 0;
///   `Ns` missing, 0 or negative is 1. Faces whose material or MTL file is missing are grey, with a warning.
/// * `map_Kd`: a file that is missing means plain `Kd`, with a warning. Backslashes separate folders; a name that
///   differs in case only is found; texture options are ignored, with a warning where they would change the picture.
/// * Vertices are shared by all corners of the same object, material, position, normal and texture coordinates;
///   materials and textures are those that faces use, and materials share a texture of the same file.
///
/// # Errors
/// Files that cannot be read; numbers that are none; indices out of range or 0; faces with a NaN or infinite value; no
/// triangle at all; paths that leave `root` (also by symbolic links); textures that cannot be decoded or exceed the
/// limits of [`crate::plane`]; more than 1 GiB of text, 50 million triangle corners or 10 000 corners of one face.
pub fn load_obj(path: &Path, root: &Path) -> Result<Scene> {
    let root = Root::new(root)?;
    let canonical = root.enter(path)?;
    let text = read_text(&canonical, path, Limit::MODEL)?;
    let geometry = obj::parse(&text, path)?;
    drop(text);
    warn_of_skipped(path, &geometry.skipped);
    let library = Library::read(&root, path, &canonical, &geometry.libraries)?;
    let triangles = assemble(&geometry, path)?;
    let (materials, textures) = library.materials(&geometry.materials)?;
    let objects = geometry.objects.into_iter().map(|name| Object { name, trajectory: None }).collect();
    Ok(triangles.finish(materials, textures, objects))
}

fn assemble(geometry: &Geometry, path: &Path) -> Result<Assembler> {
    let smooth = Smooth::new(geometry);
    let mut out = Assembler::default();
    let (mut degenerate, mut crossed) = (Faces::default(), Faces::default());
    let mut first = 0;
    for face in &geometry.faces {
        let points = positions(geometry, first..first + face.corners);
        let corners = corners(geometry, face, first, newell(&points), &smooth);
        first += face.corners;
        let triangles = match triangulate(&points) {
            Outcome::Triangles(triangles) => triangles,
            Outcome::Crossed(triangles) => {
                crossed.note(face);
                triangles
            }
            Outcome::Degenerate => {
                degenerate.note(face);
                continue;
            }
        };
        for triangle in triangles {
            out.triangle(triangle.map(|corner| corners[corner]));
        }
    }
    degenerate.warn(path, "without area, left out");
    crossed.warn(path, "whose edges cross or that bend strongly, drawn as fans");
    if out.index_count() == 0 {
        let skipped = geometry.skipped.points_and_lines;
        let found = format!(
            "no triangle ({} without area, {})",
            counted(degenerate.count, "face", "faces"),
            counted(skipped, "point or line", "points and lines")
        );
        return Err(Error::input(
            path,
            None,
            found,
            "at least one face with area (`f` and three or more corners)",
        ));
    }
    Ok(out)
}

/// The corners of a face whose first corner is number `first` in the mesh.
fn corners(
    geometry: &Geometry,
    face: &Face,
    first: usize,
    newell: glam::DVec3,
    smooth: &Smooth,
) -> Vec<Vertex> {
    let mesh = &geometry.mesh;
    let flat = newell.normalize_or(glam::DVec3::Z).as_vec3().to_array();
    let corner = |at: usize| {
        let position = mesh.indices[at];
        let [x, y, z] = triple(&mesh.positions, position);
        let given = face.has_normals.then(|| unit(triple(&mesh.normals, mesh.normal_indices[at]))).flatten();
        let uv = if face.has_uv {
            let at = 2 * mesh.texcoord_indices[at] as usize;
            [mesh.texcoords[at], mesh.texcoords[at + 1]]
        } else {
            [0.0; 2]
        };
        let normal = given.unwrap_or_else(|| smooth.at(face, position, flat));
        Vertex { position_m: [x, y, z], object: face.object, normal, material: face.material, uv }
    };
    (first..first + face.corners).map(corner).collect()
}

fn triple(values: &[f32], index: u32) -> [f32; 3] {
    let at = 3 * index as usize;
    [values[at], values[at + 1], values[at + 2]]
}

/// `None` for a normal of no length, which some exporters write for faces without area.
fn unit(normal: [f32; 3]) -> Option<[f32; 3]> {
    let normal = glam::DVec3::from_array(normal.map(f64::from)).try_normalize()?;
    Some(normal.as_vec3().to_array())
}

/// How many faces something happened to, and where first.
#[derive(Default)]
struct Faces {
    count: usize,
    first_line: usize,
}

impl Faces {
    fn note(&mut self, face: &Face) {
        if self.count == 0 {
            self.first_line = face.line;
        }
        self.count += 1;
    }

    fn warn(&self, path: &Path, what: &str) {
        if self.count > 0 {
            tracing::warn!(
                "{}:{}: {} {what} (this is the first)",
                path.display(),
                self.first_line,
                counted(self.count, "face", "faces")
            );
        }
    }
}

fn warn_of_skipped(path: &Path, skipped: &obj::Skipped) {
    let shown = path.display();
    if skipped.points_and_lines > 0 {
        let what = counted(skipped.points_and_lines, "point or line is", "points and lines are");
        tracing::warn!("{shown}: {what} left out");
    }
    if skipped.not_finite > 0 {
        let what = counted(skipped.not_finite, "value that no face uses is", "values that no face uses are");
        tracing::warn!("{shown}: {what} NaN or infinite");
    }
    if skipped.mixed > 0 {
        tracing::warn!(
            "{shown}: {} some corners only a `vt` or `vn`; both are ignored there",
            counted(skipped.mixed, "face gives", "faces give")
        );
    }
    if let Some((line, keyword)) = &skipped.first_unknown {
        tracing::warn!(
            "{shown}:{line}: {} not supported, such as {keyword}; ignored",
            counted(skipped.unknown, "line is", "lines are")
        );
    }
}
