//! The materials that a scene uses: finds MTL files and textures, and reads each file once.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::mtl::{self, DEFAULT_KD, DEFAULT_NS, Definition};
use super::obj::MaterialUse;
use super::paths::{Place, Root};
use super::text::read_text;
use crate::error::{Error, Result};
use crate::files::Limit;
use crate::plane::read_rgb8_as;
use crate::scene::{Material, Texture};

/// Most memory that all textures may take together, bytes.
const MAX_TEXTURES_BYTES: u64 = 4 << 30;
/// Most words of all `mtllib` lines: for each, files of several names are looked for.
const MAX_WORDS: usize = 1000;
/// Longest file name in `mtllib`, in words.
const MAX_WORDS_PER_NAME: usize = 16;

/// A material and the texture it names, found but not read.
struct Known {
    definition: Definition,
    texture: Option<PathBuf>,
}

/// Everything that the `mtllib` lines of a file lead to.
pub(super) struct Library<'a> {
    root: &'a Root,
    /// The OBJ file: as the caller wrote it, and canonical.
    obj: &'a Path,
    canonical_obj: &'a Path,
    known: HashMap<String, Known>,
    read: HashSet<PathBuf>,
}

impl<'a> Library<'a> {
    /// Reads the files of all `mtllib` lines. Of materials with the same name the first counts, as the format says. A
    /// file that is absent is warned of.
    ///
    /// # Errors
    /// A path that leaves the root, an MTL file that cannot be read or holds values that are no colours.
    pub(super) fn read(
        root: &'a Root,
        obj: &'a Path,
        canonical_obj: &'a Path,
        lines: &[(usize, String)],
    ) -> Result<Self> {
        let mut library = Self { root, obj, canonical_obj, known: HashMap::new(), read: HashSet::new() };
        let mut names = 0;
        for (line, operand) in lines {
            names += operand.split_whitespace().count();
            if names > MAX_WORDS {
                let found = format!("{names} words in `mtllib` lines");
                return Err(Error::input(
                    obj,
                    *line,
                    found,
                    format!("at most {MAX_WORDS}: each is looked for"),
                ));
            }
            for file in library.files(*line, operand)? {
                if library.read.insert(file.clone()) {
                    library.add(&file)?;
                }
            }
        }
        Ok(library)
    }

    /// The files that one `mtllib` line names. Several names stand side by side and each may hold blanks: from the
    /// left, the most words that name a file together are taken.
    fn files(&self, line: usize, operand: &str) -> Result<Vec<PathBuf>> {
        let place = Place { path: self.obj, line };
        let words = split_words(operand);
        for (from, to) in &words {
            // No combination may hide a name that leaves the root.
            self.root.resolve(self.canonical_obj, &unescape(&operand[*from..*to]), place)?;
        }
        let mut files = Vec::new();
        let mut at = 0;
        while at < words.len() {
            let longest = words.len().min(at + MAX_WORDS_PER_NAME);
            let mut step = 1;
            let mut file = None;
            for end in (at + 1..=longest).rev() {
                let name = unescape(&operand[words[at].0..words[end - 1].1]);
                file = self.root.resolve(self.canonical_obj, &name, place)?;
                if file.is_some() {
                    step = end - at;
                    break;
                }
            }
            if file.is_none() {
                let name = &operand[words[at].0..words[at].1];
                self.root.refuse_irregular(self.canonical_obj, &unescape(name), place)?;
                tracing::warn!(
                    "{}:{line}: no material file `{name}`; its materials are grey",
                    self.obj.display()
                );
            }
            files.extend(file);
            at += step;
        }
        Ok(files)
    }

    fn add(&mut self, file: &Path) -> Result<()> {
        let shown = self.root.show(file);
        let text = read_text(file, &shown, Limit::MATERIALS)?;
        for definition in mtl::parse(&text, &shown)? {
            let texture = match &definition.map_kd {
                Some((line, name)) => self.texture(file, name, Place { path: &shown, line: *line })?,
                None => None,
            };
            let name = definition.name.clone();
            if let Some(first) = self.known.get(&name) {
                let at = first.definition.line;
                tracing::warn!(
                    "{}:{}: material `{name}` again (first: line {at}); ignored",
                    shown.display(),
                    definition.line
                );
            } else {
                self.known.insert(name, Known { definition, texture });
            }
        }
        Ok(())
    }

    /// A texture lies beside its MTL file or, as some exporters mean it, beside the OBJ file.
    fn texture(&self, mtl: &Path, name: &str, place: Place<'_>) -> Result<Option<PathBuf>> {
        let beside_mtl = self.root.resolve(mtl, name, place)?;
        let found = beside_mtl.or_else(|| self.root.resolve(self.canonical_obj, name, place).ok().flatten());
        if found.is_none() {
            tracing::warn!(
                "{}:{}: no texture file `{name}`; plain Kd is used",
                place.path.display(),
                place.line
            );
        }
        Ok(found)
    }

    /// The materials for `uses`, in that order, and their textures, each read once.
    ///
    /// # Errors
    /// A texture that cannot be read or decoded, or is too large.
    pub(super) fn materials(&self, uses: &[MaterialUse]) -> Result<(Vec<Material>, Vec<Texture>)> {
        let mut textures = Vec::new();
        let mut places: HashMap<&Path, usize> = HashMap::new();
        let mut materials = Vec::new();
        for used in uses {
            let Some(known) = used.name.as_ref().and_then(|name| self.known.get(name)) else {
                materials.push(self.grey(used));
                continue;
            };
            let texture = match known.texture.as_deref() {
                Some(file) if !places.contains_key(file) => {
                    textures.push(read_texture(file, &self.root.show(file))?);
                    check_total(&textures)?;
                    places.insert(file, textures.len() - 1);
                    Some(textures.len() - 1)
                }
                Some(file) => places.get(file).copied(),
                None => None,
            };
            let Definition { name, kd, ks, ns, .. } = &known.definition;
            materials.push(Material { name: name.clone(), kd: *kd, ks: *ks, ns: *ns, texture });
        }
        Ok((materials, textures))
    }

    fn grey(&self, used: &MaterialUse) -> Material {
        let place = format!("{}:{}", self.obj.display(), used.line);
        match &used.name {
            Some(name) => tracing::warn!("{place}: material `{name}` is defined nowhere; its faces are grey"),
            None => tracing::warn!("{place}: faces before any `usemtl` are grey"),
        }
        let name = used.name.clone().unwrap_or_default();
        Material { name, kd: DEFAULT_KD, ks: [0.0; 3], ns: DEFAULT_NS, texture: None }
    }
}

fn read_texture(file: &Path, shown: &Path) -> Result<Texture> {
    let plane = read_rgb8_as(file, shown)?;
    let rgba = plane.data.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    Ok(Texture { path: shown.to_owned(), width: plane.width as u32, height: plane.height as u32, rgba })
}

fn check_total(textures: &[Texture]) -> Result<()> {
    let value = textures.iter().map(|t| t.rgba.len() as u64).sum();
    if value <= MAX_TEXTURES_BYTES {
        return Ok(());
    }
    let why = "a scene's textures must fit into memory together".to_owned();
    Err(Error::Limit { what: "the size of all textures in bytes", value, limit: MAX_TEXTURES_BYTES, why })
}

/// First and last byte of each word; a blank behind a backslash belongs to the word.
fn split_words(operand: &str) -> Vec<(usize, usize)> {
    let mut words = Vec::new();
    let mut start = None;
    let mut previous = ' ';
    for (at, c) in operand.char_indices() {
        if c.is_whitespace() && previous != '\\' {
            words.extend(start.take().map(|from| (from, at)));
        } else if start.is_none() {
            start = Some(at);
        }
        previous = c;
    }
    words.extend(start.map(|from| (from, operand.len())));
    words
}

fn unescape(name: &str) -> String {
    name.replace("\\ ", " ").trim_matches('"').to_owned()
}
