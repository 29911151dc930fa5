//! What the pictures show of the target, one picture in memory at a time.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hasher as _};
use std::path::Path;

use glam::DVec2;

use super::april;
use super::charuco;
use super::crossings;
use super::detect::{Found, find, nearest_px};
use super::input::Picture;
use super::instead::shown_instead;
use super::orient::{align, even_is_dark};
use super::refine::refined;
use super::select::LEAST_POINTS;
use super::target::{Pattern, Seen, Target, View};
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{Limit, read};
use shutterbug::plane::{Plane, decode_picture};

/// Difference of the gap between tags from what was said, of their side, that perspective and lenses do not explain.
const SPACING_OFF: f64 = 0.02;

/// Said of pictures that show nothing of the board.
const NO_BOARD: &str = "no board";
const NO_TAG: &str = "no tag";
/// Where no picture shows the board, so many of them are searched for another one.
const LOOKED_AT_AGAIN: usize = 3;

/// Where the points come from.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// They are looked for.
    Pictures,
    /// A table of another tool, by file name; its file.
    Table(&'a BTreeMap<String, Vec<Seen>>, &'a Path),
}

/// A picture without a view.
#[derive(Clone, Debug)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Why.
    pub why: String,
}

/// What was seen.
#[derive(Clone, Debug)]
pub struct Observed {
    /// In the order of the pictures.
    pub views: Vec<View>,
    /// Pictures that show no target.
    pub left_out: Vec<LeftOut>,
    /// Columns and rows of the pictures, px.
    pub size: [u32; 2],
    /// Whether the squares whose column and row add up to an even number are the dark ones.
    pub even_is_dark: bool,
}

/// Looks at each picture; `near`: they follow each other in time. `watch` is told how many are done, and may end it.
///
/// # Errors
/// No picture; one that cannot be read, or of another size than the first; a table with a file that is no picture, or
/// with points that the target has not; tags at other distances than the target's.
pub fn observe(
    pictures: &[Picture],
    target: &Target,
    source: Source<'_>,
    near: bool,
    watch: &mut dyn FnMut(usize) -> Result<()>,
) -> Result<Observed> {
    if let Source::Table(table, path) = source {
        check_table(table, path, pictures, target)?;
    }
    let mut all: Vec<(View, Option<bool>)> = Vec::new();
    let mut left_out = Vec::new();
    let mut offsets: Vec<DVec2> = Vec::new();
    let mut size: Option<[u32; 2]> = None;
    // Pictures whose corners in the table are another's.
    let mut strangers = 0;
    let mut clues = Clues::default();
    let mut known: BTreeMap<u64, &str> = BTreeMap::new();
    for (index, picture) in pictures.iter().enumerate() {
        let grey = read_grey(picture, &mut size, &pictures[0])?;
        // A copy is no second view, and would only make the first one count more.
        let first = *known.entry(hash_of(&grey)).or_insert(&picture.name);
        let seen = match source {
            _ if first != picture.name => Err(format!("the same picture as {first}")),
            Source::Pictures => look(&grey, target, &mut clues),
            Source::Table(table, _) => match table.get(&picture.name) {
                Some(seen) => given(&grey, seen, target, (&mut offsets, &mut strangers)),
                None => Err("no corners of it in the table".to_owned()),
            },
        };
        let seen = seen.and_then(|s| if s.len() < LEAST_POINTS { Err(too_few(s.len())) } else { Ok(s) });
        match seen {
            Ok(seen) => {
                let view = View { picture: index, seen };
                let dark = even_is_dark(&grey, &view, target.size);
                all.push((view, dark));
            }
            Err(why) => left_out.push(LeftOut { name: picture.name.clone(), why }),
        }
        watch(index + 1)?;
    }
    if all.is_empty() && matches!(source, Source::Pictures) {
        name_others(&mut left_out, pictures, target, &mut size)?;
    }
    check_strangers(strangers, source)?;
    check_spacing(&clues.spacings, target)?;
    check_size(&clues.grids, all.len(), target)?;
    let (mut views, dark): (Vec<View>, Vec<Option<bool>>) = all.into_iter().unzip();
    let shift = DVec2::splat(pixel_origin(&offsets));
    views.iter_mut().flat_map(|v| &mut v.seen).for_each(|s| s.px += shift);
    let even_is_dark = match target.pattern {
        Pattern::Checkerboard => align(&mut views, &dark, target.size, near),
        _ => true,
    };
    left_out.extend(unlike_the_rest(&mut views, pictures));
    let size =
        size.ok_or_else(|| Error::input(Path::new("board"), None, "no picture", "pictures of the board"))?;
    Ok(Observed { views, left_out, size, even_is_dark })
}

/// Takes out the views that lost their points to the colours of most.
fn unlike_the_rest(views: &mut Vec<View>, pictures: &[Picture]) -> Vec<LeftOut> {
    let why = "its dark squares lie where the others' bright ones do";
    let empty = views.extract_if(.., |v| v.seen.is_empty());
    empty.map(|v| LeftOut { name: pictures[v.picture].name.clone(), why: why.to_owned() }).collect()
}

/// Says of the first pictures which board they show in place of the one that was asked for.
fn name_others(
    left_out: &mut [LeftOut],
    pictures: &[Picture],
    target: &Target,
    size: &mut Option<[u32; 2]>,
) -> Result<()> {
    let nothing = |why: &str| [NO_BOARD, NO_TAG].contains(&why);
    for of in left_out.iter_mut().filter(|l| nothing(&l.why)).take(LOOKED_AT_AGAIN) {
        let Some(picture) = pictures.iter().find(|p| p.name == of.name) else { continue };
        if let Some(other) = shown_instead(&read_grey(picture, size, &pictures[0])?, target) {
            of.why = format!("{}, but {other}", of.why);
        }
    }
    Ok(())
}

fn hash_of(grey: &Plane<u8>) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(&grey.data);
    hasher.finish()
}

fn too_few(count: usize) -> String {
    format!("{} of the board, fewer than {LEAST_POINTS}", counted(count, "point", "points"))
}

/// A table's corners of a picture, or why they are none of it: those of tags are no crossings, and are not asked.
/// Collects how far they are off, and counts those that are none.
fn given(
    grey: &Plane<u8>,
    seen: &[Seen],
    target: &Target,
    (offsets, strangers): (&mut Vec<DVec2>, &mut usize),
) -> std::result::Result<Vec<Seen>, String> {
    offsets.extend(seen.iter().filter_map(|s| offset(grey, seen, s)));
    let why_not = (target.pattern != Pattern::Aprilgrid).then(|| crossings::why_not(grey, seen)).flatten();
    *strangers += usize::from(why_not.is_some());
    why_not.map_or_else(|| Ok(seen.to_vec()), Err)
}

/// A table whose corners lie elsewhere in most pictures is of other pictures, or has its axes otherwise.
fn check_strangers(strangers: usize, source: Source<'_>) -> Result<()> {
    let Source::Table(table, path) = source else { return Ok(()) };
    if 2 * strangers <= table.len() {
        return Ok(());
    }
    let found =
        format!("corners that are not where squares meet, in {strangers} of {} pictures", table.len());
    let expected = "the corners of these pictures, at this size: u to the right, v down, px";
    Err(Error::input(path, None, found, expected))
}

/// Tags that lie closer together or further apart than was said would bend the camera.
fn check_spacing(spacings: &[f64], target: &Target) -> Result<()> {
    let mut sorted = spacings.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (Some(said), Some(found)) = (target.tag_spacing, sorted.get(sorted.len() / 2)) else {
        return Ok(());
    };
    if (found - said).abs() <= SPACING_OFF {
        return Ok(());
    }
    let found = format!("tags that lie {found:.3} of their side apart");
    Err(Error::input(Path::new("--tag-spacing"), None, found, format!("{said}, as was said")))
}

fn check_table(
    table: &BTreeMap<String, Vec<Seen>>,
    path: &Path,
    pictures: &[Picture],
    target: &Target,
) -> Result<()> {
    if let Some(name) = table.keys().find(|n| !pictures.iter().any(|p| p.name == **n)) {
        return Err(Error::input(path, None, format!("corners of `{name}`"), "names of the pictures given"));
    }
    let outside = |s: &&Seen| s.point[0] >= target.size[0] || s.point[1] >= target.size[1];
    if let Some(s) = table.values().flatten().find(outside) {
        let found = format!("a corner in column {}, row {}", s.point[0], s.point[1]);
        return Err(Error::input(path, None, found, format!("those of a {}", target.describe())));
    }
    Ok(())
}

/// A picture's brightness; all must be of the first one's size.
fn read_grey(picture: &Picture, size: &mut Option<[u32; 2]>, first: &Picture) -> Result<Plane<u8>> {
    let grey = decode_picture(&picture.path, &read(&picture.path, Limit::PICTURE)?)?.into_luma8();
    let found = [grey.width(), grey.height()];
    let wanted = *size.get_or_insert(found);
    if found != wanted {
        let found = format!("{}x{} px", found[0], found[1]);
        let expected = format!("{}x{} px as in {}", wanted[0], wanted[1], first.path.display());
        return Err(Error::input(&picture.path, None, found, expected));
    }
    Ok(Plane { width: found[0] as usize, height: found[1] as usize, channels: 1, data: grey.into_raw() })
}

/// A grid with more columns or rows than the board is no part of it: where most pictures show such, another board was
/// photographed, and in the rest a part of it was found.
fn check_size(grids: &[[usize; 2]], views: usize, target: &Target) -> Result<()> {
    let [long, short] = [target.size[0].max(target.size[1]), target.size[0].min(target.size[1])];
    let mut larger: Vec<[usize; 2]> = grids.iter().map(|g| [g[0].max(g[1]), g[0].min(g[1])]).collect();
    larger.retain(|g| g[0] > long || g[1] > short);
    if larger.len() <= views {
        return Ok(());
    }
    let times = |size: &[usize; 2]| larger.iter().filter(|g| *g == size).count();
    let Some([columns, rows]) = larger.iter().max_by_key(|g| (times(g), **g)) else { return Ok(()) };
    let found = format!(
        "grids of {columns}x{rows} inner corners in {} of the pictures, and the {} in {views}",
        times(&[*columns, *rows]),
        target.describe()
    );
    Err(Error::input(Path::new("--size"), None, found, format!("{columns}x{rows}, which most pictures show")))
}

/// What pictures show beside the points.
#[derive(Default)]
struct Clues {
    /// How far apart the tags of an AprilGrid lie.
    spacings: Vec<f64>,
    /// Columns and rows of grids that are not the board's.
    grids: Vec<[usize; 2]>,
}

/// Points of the target in a picture, or what is there instead.
fn look(grey: &Plane<u8>, target: &Target, clues: &mut Clues) -> std::result::Result<Vec<Seen>, String> {
    match target.pattern {
        Pattern::Checkerboard => {}
        Pattern::Charuco => return charuco::find(grey, target).ok_or_else(|| NO_BOARD.to_owned()),
        Pattern::Aprilgrid => {
            return match april::find(grey, target) {
                april::Found::Board(seen, spacing) => {
                    clues.spacings.extend(spacing);
                    Ok(seen)
                }
                april::Found::Other(what) => Err(what),
                april::Found::Nothing => Err(NO_TAG.to_owned()),
            };
        }
    }
    match find(grey, target.size) {
        Found::Board(seen) => Ok(seen),
        Found::Other([c, r]) => {
            clues.grids.push([c, r]);
            Err(format!("a grid of {c}x{r} inner corners, whose place on the board is open"))
        }
        Found::Nothing => Err(NO_BOARD.to_owned()),
    }
}

/// How far a corner of a table is from where the picture has it, px.
fn offset(grey: &Plane<u8>, seen: &[Seen], s: &Seen) -> Option<DVec2> {
    // OpenCV's places lie half a pixel up and left of these; both lie within the window.
    let at = s.px + 0.25;
    refined(grey, at, nearest_px(seen, s), 1).map(|px| px - s.px)
}

/// Half a pixel where a table counts from the centre of the first pixel, as OpenCV does; else nothing. Its own corners
/// tell: the middle of what they are off by is nearer to one of both.
fn pixel_origin(offsets: &[DVec2]) -> f64 {
    let mut both: Vec<f64> = offsets.iter().flat_map(|o| [o.x, o.y]).collect();
    both.sort_by(f64::total_cmp);
    if both.get(both.len() / 2).is_some_and(|middle| *middle > 0.25) { 0.5 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As of a board of 8x6 said to be 7x6: parts of it pass for the whole in some pictures.
    #[test]
    fn larger_grids_in_most_pictures_are_another_board() {
        let said = |size: [usize; 2], grids: &[[usize; 2]], views: usize| {
            check_size(grids, views, &Target::checkerboard(size, [1.0; 2])).map_err(|e| e.to_string())
        };
        let mut grids = vec![[8, 6]; 8];
        grids.extend([[6, 8], [6, 8], [6, 8], [6, 4], [7, 5]]);
        let refused = said([7, 6], &grids, 5).expect_err("another board");
        assert!(refused.contains("--size: found grids of 8x6") && refused.contains("in 11 of"), "{refused}");
        // Control: parts of the board, and a few wrong ones.
        assert_eq!(said([8, 6], &grids, 5), Ok(()));
        assert_eq!(said([7, 6], &grids[..4], 5), Ok(()));
    }
}
