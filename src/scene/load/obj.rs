//! OBJ text to faces. The `tobj` crate reads the numbers and gathers the mesh; a scan before it owns what `tobj` does
//! not do: line numbers in errors, ranges of indices, NaN, the difference of `o` and `g`, smoothing groups, and the
//! spellings on which it stops or goes wrong (measured with 4.0.5: a zero index reads as "absent" or as out of bounds,
//! a fourth number of `v` divides the other three, colours on some vertices only shift those of the others, an empty
//! `usemtl` and a `vt` of one number stop it). What `tobj` sees is text that the scan wrote anew: numbers as they
//! stand, indices absolute and in range.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use super::text::{excerpt, logical_lines, number, split_keyword, words};
use crate::error::{Error, Result};

/// Furthest vertex, m, the same as of a trajectory: beyond, single precision draws wrong pictures without a word.
pub const MAX_COORDINATE_M: f32 = 1e9;
/// Most corners of triangles that a scene may have.
pub const MAX_INDICES: usize = 50_000_000;
/// Most corners of one polygon: ear clipping takes quadratic time at worst.
pub const MAX_CORNERS: usize = 10_000;

/// A polygon of at least three corners.
#[derive(Clone, Copy)]
pub(super) struct Face {
    pub line: usize,
    pub corners: usize,
    /// Index into [`Geometry::objects`].
    pub object: u32,
    /// Index into [`Geometry::materials`].
    pub material: u32,
    /// Smoothing group, 0: none.
    pub smoothing: u32,
    /// Whether every corner has texture coordinates.
    pub has_uv: bool,
    /// Whether every corner has a normal.
    pub has_normals: bool,
}

/// A material that faces use.
pub(super) struct MaterialUse {
    /// `None`: the faces before any `usemtl`.
    pub name: Option<String>,
    /// The line of the first face that uses it.
    pub line: usize,
}

/// What was left out, by kind.
#[derive(Default)]
pub(super) struct Skipped {
    /// Elements of `p` and `l`, and faces of one or two corners.
    pub points_and_lines: usize,
    /// Values of `v`, `vt`, `vn` that are not finite and that no face uses.
    pub not_finite: usize,
    /// Faces of which some corners only have texture coordinates or normals: both are ignored.
    pub mixed: usize,
    /// Lines with an unknown or unsupported keyword, and the first of them.
    pub unknown: usize,
    pub first_unknown: Option<(usize, String)>,
}

/// The faces of a file, in its order.
pub(super) struct Geometry {
    pub faces: Vec<Face>,
    /// Positions, texture coordinates and normals, with one index of each kind for every corner of every face (none of
    /// a kind that no face has).
    pub mesh: tobj::Mesh,
    /// Names, in the order of first use.
    pub objects: Vec<String>,
    pub materials: Vec<MaterialUse>,
    /// Line and operand of each `mtllib`.
    pub libraries: Vec<(usize, String)>,
    pub skipped: Skipped,
}

/// Parses the text of an OBJ file; `path` is for errors.
pub(super) fn parse(text: &str, path: &Path) -> Result<Geometry> {
    let mut scan = Scan::new(path);
    scan.attributes(text)?;
    for (line, content) in logical_lines(text) {
        scan.statement(line, &content)?;
    }
    scan.finish()
}

/// The three kinds of attribute, in the order of `v/vt/vn`.
const KEYWORDS: [&str; 3] = ["v", "vt", "vn"];
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
const NEEDED: [&str; 3] =
    ["three numbers after `v`", "one to three numbers after `vt`", "three numbers after `vn`"];

struct Scan<'a> {
    path: &'a Path,
    /// Number of `v`, `vt`, `vn` in the whole file: a positive index may point forward.
    total: [usize; 3],
    /// Number so far: what a negative index counts from.
    so_far: [usize; 3],
    /// Index (from 1) and line of those that are not finite.
    not_finite: [HashMap<usize, usize>; 3],
    /// The text for `tobj`.
    clean: String,
    object: Option<u32>,
    object_places: HashMap<String, u32>,
    material: Option<String>,
    material_places: HashMap<Option<String>, u32>,
    smoothing: u32,
    indices: usize,
    out: Geometry,
}

impl<'a> Scan<'a> {
    fn new(path: &'a Path) -> Self {
        let out = Geometry {
            faces: Vec::new(),
            mesh: tobj::Mesh::default(),
            objects: Vec::new(),
            materials: Vec::new(),
            libraries: Vec::new(),
            skipped: Skipped::default(),
        };
        Self {
            path,
            total: [0; 3],
            so_far: [0; 3],
            not_finite: Default::default(),
            clean: String::new(),
            object: None,
            object_places: HashMap::new(),
            material: None,
            material_places: HashMap::new(),
            smoothing: 0,
            indices: 0,
            out,
        }
    }

    fn bad(&self, line: usize, found: String, expected: impl Into<String>) -> Error {
        Error::input(self.path, line, found, expected)
    }

    /// First pass: all `v`, `vt`, `vn`.
    fn attributes(&mut self, text: &str) -> Result<()> {
        for (line, content) in logical_lines(text) {
            let (keyword, rest) = split_keyword(&content);
            let Some(kind) = KEYWORDS.iter().position(|k| *k == keyword) else { continue };
            self.total[kind] += 1;
            let dimension = if kind == 1 { 2 } else { 3 };
            let mut values = words(rest);
            let _ = write!(self.clean, "{keyword}");
            for i in 0..dimension {
                // A `vt` of one number belongs to a one-dimensional texture; what follows the third number of `v` is a
                // weight or a colour, neither of which means anything for a mesh without curves.
                let word = values.next().or((kind == 1 && i == 1).then_some("0"));
                let value = word.and_then(number);
                let value = value.ok_or_else(|| self.bad(line, excerpt(&content), NEEDED[kind]))?;
                if kind == 0 && value.is_finite() && value.abs() > MAX_COORDINATE_M {
                    let expected = format!("metres, at most {MAX_COORDINATE_M:e}");
                    return Err(self.bad(line, format!("the coordinate {value:e}"), expected));
                }
                if !value.is_finite() {
                    self.not_finite[kind].insert(self.total[kind], line);
                }
                let _ = write!(self.clean, " {}", word.filter(|_| value.is_finite()).unwrap_or("nan"));
            }
            self.clean.push('\n');
        }
        Ok(())
    }

    /// Second pass: everything else.
    fn statement(&mut self, line: usize, content: &str) -> Result<()> {
        let (keyword, rest) = split_keyword(content);
        if let Some(kind) = KEYWORDS.iter().position(|k| *k == keyword) {
            self.so_far[kind] += 1;
            return Ok(());
        }
        match keyword {
            "f" | "fo" => self.face(line, content, rest)?,
            "o" => self.object = Some(self.object_named(rest)),
            "usemtl" => self.material = Some(rest.to_owned()),
            "mtllib" => self.out.libraries.push((line, rest.to_owned())),
            "s" => self.smoothing = words(rest).next().map_or(0, smoothing_group),
            "p" | "l" => self.out.skipped.points_and_lines += 1,
            // Groups never split an object; display and selection hints change no pixel.
            "g" | "vw" | "lod" | "bevel" | "c_interp" | "d_interp" | "shadow_obj" | "trace_obj" => {}
            other => {
                self.out.skipped.unknown += 1;
                self.out.skipped.first_unknown.get_or_insert_with(|| (line, excerpt(other)));
            }
        }
        Ok(())
    }

    fn object_named(&mut self, name: &str) -> u32 {
        let objects = &mut self.out.objects;
        *self.object_places.entry(name.to_owned()).or_insert_with(|| {
            objects.push(name.to_owned());
            objects.len() as u32 - 1
        })
    }

    fn face(&mut self, line: usize, content: &str, rest: &str) -> Result<()> {
        let mut corners = Vec::new();
        for word in words(rest) {
            corners.push(self.corner(line, content, word)?);
            if corners.len() > MAX_CORNERS {
                let found = format!("a face of more than {MAX_CORNERS} corners");
                return Err(self.bad(line, found, format!("at most {MAX_CORNERS}")));
            }
        }
        if corners.len() < 3 {
            self.out.skipped.points_and_lines += 1;
            return Ok(());
        }
        self.indices += 3 * (corners.len() - 2);
        if self.indices > MAX_INDICES {
            let found = format!("the corner of a triangle beyond {MAX_INDICES}");
            return Err(self.bad(
                line,
                found,
                format!("at most {MAX_INDICES} corners of triangles in a file"),
            ));
        }
        let count_with = |kind: usize| corners.iter().filter(|c| c[kind].is_some()).count();
        let (uvs, normals) = (count_with(1), count_with(2));
        self.out.skipped.mixed += usize::from([uvs, normals].iter().any(|n| *n != 0 && *n != corners.len()));
        let object = match self.object {
            Some(object) => object,
            None => self.object_named(""),
        };
        let face = Face {
            line,
            corners: corners.len(),
            object,
            material: self.current_material(line),
            smoothing: self.smoothing,
            has_uv: uvs == corners.len(),
            has_normals: normals == corners.len(),
        };
        self.out.faces.push(face);
        self.write_face(&corners, &face);
        Ok(())
    }

    fn current_material(&mut self, line: usize) -> u32 {
        let materials = &mut self.out.materials;
        if let Some(known) = self.material_places.get(&self.material) {
            return *known;
        }
        materials.push(MaterialUse { name: self.material.clone(), line });
        self.material_places.insert(self.material.clone(), materials.len() as u32 - 1);
        materials.len() as u32 - 1
    }

    /// Writing to a `String` cannot fail.
    fn write_face(&mut self, corners: &[[Option<usize>; 3]], face: &Face) {
        self.clean.push('f');
        for corner in corners {
            let _ = write!(self.clean, " {}", corner[0].unwrap_or(0));
            match (corner[1].filter(|_| face.has_uv), corner[2].filter(|_| face.has_normals)) {
                (Some(uv), Some(normal)) => drop(write!(self.clean, "/{uv}/{normal}")),
                (Some(uv), None) => drop(write!(self.clean, "/{uv}")),
                (None, Some(normal)) => drop(write!(self.clean, "//{normal}")),
                (None, None) => {}
            }
        }
        self.clean.push('\n');
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn` to absolute indices, from 1, in range.
    fn corner(&mut self, line: usize, content: &str, word: &str) -> Result<[Option<usize>; 3]> {
        let mut found = [None; 3];
        for (kind, part) in word.split('/').enumerate() {
            match (kind, part.parse()) {
                (0..3, Ok(index)) => found[kind] = Some(self.absolute(line, content, kind, index)?),
                (1..3, Err(_)) if part.is_empty() => {}
                _ => {
                    let found = format!("{} in {}", excerpt(word), excerpt(content));
                    return Err(self.bad(line, found, "integers as `v`, `v/vt`, `v//vn` or `v/vt/vn`"));
                }
            }
        }
        Ok(found)
    }

    fn absolute(&mut self, line: usize, content: &str, kind: usize, index: i64) -> Result<usize> {
        let (total, so_far) = (self.total[kind], self.so_far[kind]);
        let magnitude = usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX);
        let absolute = match index {
            1.. if magnitude <= total => magnitude,
            ..=-1 if magnitude <= so_far => so_far + 1 - magnitude,
            _ => {
                let found = format!("{} index {index} in {}", KINDS[kind], excerpt(content));
                let keyword = KEYWORDS[kind];
                let expected = match index {
                    0 => "a number from 1 up, or from -1 down".to_owned(),
                    1.. if total == 0 => format!("no such index: the file has no `{keyword}` line"),
                    1.. => format!("at most {total}, the number of `{keyword}` lines in the file"),
                    _ if so_far == 0 => format!("no such index: no `{keyword}` line stands before this one"),
                    _ => format!("at least -{so_far}: so many `{keyword}` lines stand before this one"),
                };
                return Err(self.bad(line, found, expected));
            }
        };
        if let Some(at) = self.not_finite[kind].get(&absolute) {
            let found =
                format!("a face with {} {absolute}, which line {at} gives as NaN or infinite", KINDS[kind]);
            return Err(self.bad(line, found, "finite numbers"));
        }
        Ok(absolute)
    }

    fn finish(mut self) -> Result<Geometry> {
        self.out.skipped.not_finite = self.not_finite.iter().map(HashMap::len).sum();
        if self.out.faces.is_empty() {
            return Ok(self.out);
        }
        let options = tobj::LoadOptions { triangulate: false, single_index: false, ..Default::default() };
        let refused =
            |found: String| Error::input(self.path, None, found, "geometry that the OBJ reader accepts");
        let (models, _) =
            tobj::load_obj_buf(&mut self.clean.as_bytes(), &options, |_| Ok(Default::default()))
                .map_err(|e| refused(e.to_string()))?;
        let mut meshes = models.into_iter().map(|model| model.mesh);
        let mesh = meshes.next().ok_or_else(|| refused("no mesh".to_owned()))?;
        let corners: usize = self.out.faces.iter().map(|face| face.corners).sum();
        let complete =
            |indices: &[u32], needed: bool| indices.len() == corners || (indices.is_empty() && !needed);
        let whole = complete(&mesh.indices, true)
            && complete(&mesh.texcoord_indices, self.out.faces.iter().any(|f| f.has_uv))
            && complete(&mesh.normal_indices, self.out.faces.iter().any(|f| f.has_normals));
        if !whole || meshes.next().is_some() {
            return Err(refused(format!("{} corners where the scan counted {corners}", mesh.indices.len())));
        }
        self.out.mesh = mesh;
        Ok(self.out)
    }
}

/// `off` and 0 are none; a word that is no number switches on like a group of its own kind, 1.
fn smoothing_group(word: &str) -> u32 {
    if word.eq_ignore_ascii_case("off") { 0 } else { word.parse().unwrap_or(1) }
}
