//! What pictures show where the board that was asked for is in none of them.

use calib_targets_charuco::builtins::BUILTIN_DICTIONARY_NAMES;

use super::april;
use super::charuco;
use super::detect::{grid_in, sizes};
use super::target::{Marker, Pattern, Target};
use shutterbug::plane::Plane;

/// Markers of few bits are seen where there are none: a board in another dictionary shows so many of its corners.
const SHARE_OF_CORNERS: f64 = 0.25;

/// Another board that the picture shows, and how it is asked for; none if it shows none.
pub(super) fn shown_instead(grey: &Plane<u8>, target: &Target) -> Option<String> {
    if target.pattern == Pattern::Charuco
        && let Some(name) = other_dictionary(grey, target)
    {
        return Some(format!("one with markers of another dictionary: --dictionary {name}"));
    }
    if target.pattern != Pattern::Aprilgrid
        && let Some(count) = april::count_in(grey)
    {
        return Some(format!("{count} tags of the family t36h11: --pattern aprilgrid"));
    }
    if target.pattern == Pattern::Checkerboard {
        return None;
    }
    let grids = sizes(grey).into_iter().filter_map(|shrunk| grid_in(grey, shrunk));
    let [columns, rows] = grids.map(|g| g.size).max_by_key(|s| s[0] * s[1])?;
    Some(format!(
        "squares with {columns}x{rows} inner corners: --pattern checkerboard, or markers unlike these"
    ))
}

/// The dictionary in which the board's markers are found after all.
fn other_dictionary(grey: &Plane<u8>, target: &Target) -> Option<&'static str> {
    let asked = target.marker?;
    let found_with = |name: &&'static str| {
        let with = Target { marker: Some(Marker { dictionary: name, ..asked }), ..target.clone() };
        let found = charuco::find(grey, &with).map_or(0, |seen| seen.len());
        (found as f64 > SHARE_OF_CORNERS * target.count() as f64).then_some((found, *name))
    };
    let others = BUILTIN_DICTIONARY_NAMES.iter().filter(|n| **n != asked.dictionary);
    // Of two that share their first markers the smaller one, which stands first, is the usual print.
    others.filter_map(found_with).rev().max_by_key(|(found, _)| *found).map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Sheet;
    use super::*;
    use glam::DVec2;

    #[test]
    fn another_board_is_named_with_the_option_that_asks_for_it() {
        let asked = Target::charuco([7, 5], 0.04, 0.75, "DICT_5X5_100").expect("a dictionary");
        let print = |dictionary: &str| {
            let target = Target::charuco([7, 5], 0.04, 0.75, dictionary).expect("a dictionary");
            let sheet = charuco::sheet(&target).expect("drawn");
            sheet.picture([480, 400], DVec2::new(70.0, 90.0), DVec2::splat(56.0 / 0.04))
        };
        let other = shown_instead(&print("DICT_6X6_250"), &asked).expect("markers");
        assert!(other.contains("--dictionary DICT_6X6_"), "{other}");

        let tags = Target::aprilgrid([4, 3], 0.05, 0.3).expect("twelve tags");
        let sheet = april::sheet(&tags).expect("drawn");
        let tags_seen =
            sheet.picture([420, 330], DVec2::new(42.0, 270.0), DVec2::new(1.0, -1.0) * 62.0 / 0.05);
        let squares = Target::checkerboard([7, 4], [0.04; 2]);
        for target in [&asked, &squares] {
            let said = shown_instead(&tags_seen, target).expect("tags");
            assert!(said.starts_with("12 tags") && said.contains("--pattern aprilgrid"), "{said}");
        }

        let plain = Sheet::checkerboard(&squares, true, [1.0; 4]);
        let plain = plain.picture([480, 400], DVec2::new(90.0, 90.0), DVec2::splat(40.0 / 0.04));
        for target in [&asked, &tags] {
            let said = shown_instead(&plain, target).expect("squares");
            assert!(said.contains("7x4 inner corners"), "{said}");
        }
        // Control: a wall.
        let wall = Plane { width: 480, height: 400, channels: 1, data: vec![120; 480 * 400] };
        for target in [&asked, &tags, &squares] {
            assert_eq!(shown_instead(&wall, target), None);
        }
    }
}
