//! The name that was meant, for suggestions.

/// The name among `known` that was probably meant: the same start (`exposure_s` for `exposure_time_s`), or at most two
/// letters of five otherwise (`fone` for `phone`). 0.85 refuses words that only share some letters (see the tests).
pub(super) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = name.to_lowercase();
    let likeness = |known: &str| {
        let known = known.to_lowercase();
        let (typos, longest) = (typos(&name, &known), name.len().max(known.len()));
        let few = 5 * typos <= 2 * longest;
        (jaro_winkler(&name, &known), few)
    };
    let best = known.into_iter().map(|k| (likeness(k), k)).max_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
    let ((alike, few), known) = best;
    (alike >= 0.85 || few).then_some(known)
}

/// Letters to insert, remove, change or swap with their neighbour, each at most once (optimal string alignment).
fn typos(a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(|s| s.chars().collect::<Vec<_>>());
    // Of the first i letters of `a` from the first j of `b`.
    let mut least = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            least[i][j] = match (i, j) {
                (0, other) | (other, 0) => other,
                _ => {
                    let changed = least[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                    let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                    let swap = if swapped { least[i - 2][j - 2] + 1 } else { usize::MAX };
                    changed.min(least[i - 1][j] + 1).min(least[i][j - 1] + 1).min(swap)
                }
            };
        }
    }
    least[a.len()][b.len()]
}

/// Likeness after Jaro and Winkler, 0 to 1: shared letters near the same place, in the same order; more for the same
/// start.
fn jaro_winkler(a: &str, b: &str) -> f64 {
    let [a, b] = [a, b].map(|s| s.chars().collect::<Vec<_>>());
    let reach = (a.len().max(b.len()) / 2).saturating_sub(1);
    let mut taken = vec![false; b.len()];
    let mut shared = Vec::new();
    for (i, letter) in a.iter().enumerate() {
        let near = i.saturating_sub(reach)..b.len().min(i + reach + 1);
        if let Some(j) = near.clone().find(|&j| !taken[j] && b[j] == *letter) {
            taken[j] = true;
            shared.push(*letter);
        }
    }
    if shared.is_empty() {
        return if a.is_empty() && b.is_empty() { 1.0 } else { 0.0 };
    }
    let in_b = b.iter().zip(&taken).filter(|(_, taken)| **taken).map(|(letter, _)| letter);
    let moved = shared.iter().zip(in_b).filter(|(a, b)| a != b).count() / 2;
    let count = shared.len() as f64;
    let jaro = (count / a.len() as f64 + count / b.len() as f64 + (count - moved as f64) / count) / 3.0;
    let start = a.iter().zip(&b).take(4).take_while(|(a, b)| a == b).count() as f64;
    if jaro > 0.7 { jaro + 0.1 * start * (1.0 - jaro) } else { jaro }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suggestion_is_made_only_for_a_name_that_could_have_been_meant() {
        let known =
            ["width", "height", "frame_period_s", "readout_time_s", "rolling_shutter", "exposure_time_s"];
        for (typed, meant) in [
            ("widht", "width"),
            ("Width", "width"),
            ("frame_period", "frame_period_s"),
            ("readout_s", "readout_time_s"),
            ("exposure_s", "exposure_time_s"),
            ("rollingshutter", "rolling_shutter"),
            ("with", "width"),
        ] {
            assert_eq!(nearest(typed, known), Some(meant), "{typed}");
        }
        for typed in ["banana", "", "x", "noise", "distortion"] {
            assert_eq!(nearest(typed, known), None, "{typed}");
        }
        assert_eq!(
            nearest("fone", ["humanoid-2008", "machine-vision", "phone", "usb-webcam"]),
            Some("phone")
        );
        assert_eq!(nearest("width", []), None);
    }

    #[test]
    fn distances_and_likenesses_are_those_of_the_literature() {
        for (a, b, distance) in [
            ("ca", "abc", 3),
            ("kitten", "sitting", 3),
            ("widht", "width", 1),
            ("", "abc", 3),
            ("abc", "abc", 0),
        ] {
            assert_eq!(typos(a, b), distance, "{a} {b}");
        }
        // Winkler 1990, table 1.
        for (a, b, alike) in
            [("martha", "marhta", 0.9611), ("dwayne", "duane", 0.84), ("dixon", "dicksonx", 0.8133)]
        {
            assert!((jaro_winkler(a, b) - alike).abs() < 1e-4, "{a} {b}: {}", jaro_winkler(a, b));
        }
        assert_eq!(
            [jaro_winkler("", ""), jaro_winkler("", "a"), jaro_winkler("abc", "xyz")],
            [1.0, 0.0, 0.0]
        );
    }
}
