//! Frames that are not where `frames.csv` has them: late, dropped, doubled, reversed, or of another scene.

use super::Pairs;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::search::odd::Odd;
use shutterbug::error::counted;
use shutterbug::plane::stats::median;

/// What another simulated frame must leave of the unlikeness to its own for a real one to be that frame.
const LEFT: f64 = 0.15;
/// Unlikeness to its own below which a frame is where it should be.
const ALIKE: f64 = 5e-4;
/// Furthest that a frame is looked for from its place, frames.
const FURTHEST: usize = 30;
/// Most frame numbers that a sentence lists.
const MOST_LISTED: usize = 8;

/// For each real frame the place of the simulated one that it is.
fn matches(pairs: &Pairs) -> Vec<usize> {
    let count = pairs.real.len();
    let unlike = |i: usize, j: usize| pairs.real[i].unlike(&pairs.simulated[j]);
    let best = |i: usize| {
        let own = unlike(i, i);
        if own < ALIKE {
            return i;
        }
        let near = (i.saturating_sub(FURTHEST)..count.min(i + FURTHEST + 1)).chain([count - 1 - i]);
        let (j, left) =
            near.map(|j| (j, unlike(i, j))).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((i, own));
        if left < LEFT * own { j } else { i }
    };
    (0..count).map(best).collect()
}

/// What the order of the frames is, if it is not that of `frames.csv`.
pub(super) fn order(pairs: &Pairs) -> Option<String> {
    let found = matches(pairs);
    let count = found.len();
    let moved = found.iter().enumerate().filter(|(i, j)| i != *j).count();
    if count < 4 || 3 * moved < count {
        return None;
    }
    let share = |is: &dyn Fn(usize, usize) -> bool, of: usize| {
        found.iter().enumerate().filter(|(i, j)| is(*i, **j)).count() * 10 >= of * 9
    };
    if share(&|i, j| j == count - 1 - i, count) {
        return Some(
            "the real frames are in the reverse order: the last resembles the simulation of the first"
                .to_owned(),
        );
    }
    if share(&|_, j| j == found[0], count) {
        return Some("all real frames are one and the same frame".to_owned());
    }
    for late in 1..=(count / 2).min(FURTHEST) {
        let inside = count - late;
        let of = |ahead: bool| match ahead {
            true => share(&|i, j| j == i + late, inside),
            false => share(&|i, j| i == j + late, inside),
        };
        if let Some(ahead) = [true, false].into_iter().find(|a| of(*a)) {
            // A fraction of a frame more or less is a time offset, which is a camera's.
            return whole(pairs, late, ahead).then(|| shifted(late, ahead));
        }
    }
    if share(&|i, j| j == i / 2, count) {
        return Some("each real frame stands there twice: the simulation has moved on by then".to_owned());
    }
    from_a_frame_on(pairs, &found).or_else(|| {
        let how = match found.is_sorted() {
            _ if is_between_frames(pairs, &found) => return None,
            true => "in order: some were dropped or put in, or the clocks run at other rates",
            false => "they are out of order",
        };
        Some(format!("{moved} of {count} real frames resemble the simulation of other times; {how}"))
    })
}

/// Whether all frames may be late by the same time, which is no whole number of frames: a time offset, which is a
/// camera's. Each then resembles one of the two frames that the time lies between, and none its own.
fn is_between_frames(pairs: &Pairs, found: &[usize]) -> bool {
    let shift = |i: usize| found[i] as i64 - i as i64;
    let moved: Vec<usize> = (0..found.len()).filter(|i| shift(*i) != 0).collect();
    let least = moved.iter().map(|i| shift(*i)).min().unwrap_or(0);
    moved.iter().all(|i| (least..=least + 1).contains(&shift(*i)))
        && (0..found.len()).filter(|i| shift(*i) == 0).all(|i| !is_right(pairs, found, i))
}

/// Whether a frame that resembles no other time better than its own is where it should be: it is off by far less than
/// those that are not.
fn is_right(pairs: &Pairs, found: &[usize], i: usize) -> bool {
    let own = |i: usize| pairs.real[i].unlike(&pairs.simulated[i]);
    let moved = (0..found.len()).filter(|i| found[*i] != *i);
    own(i) <= LEFT * median(moved.map(own))
}

/// Whether frames fit so many frames later (or earlier) so much better than one frame beside that, that they are late
/// by a whole number: the unlikeness grows with the square of what is missing, so 0.03 is 0.15 of a frame.
fn whole(pairs: &Pairs, late: usize, ahead: bool) -> bool {
    let count = pairs.real.len();
    let left = |late: usize| {
        let pair = |i: usize| if ahead { (i, i + late) } else { (i + late, i) };
        let inside = (0..count - late).map(pair);
        median(inside.map(|(i, j)| pairs.real[i].unlike(&pairs.simulated[j])))
    };
    let beside = left(late - 1).min(left((late + 1).min(count - 1)));
    left(late) < 0.03 * beside
}

fn shifted(late: usize, ahead: bool) -> String {
    let (is, before) = if ahead { ("later", "dropped") } else { ("earlier", "put in") };
    let (frames, were) = (counted(late, "frame", "frames"), counted(late, "frame was", "frames were"));
    format!(
        "each real frame is the one that the simulation shows {frames} {is}: frames.csv and real/ are \
         shifted, {were} {before} at the start, or the clocks are off by a whole number of frames"
    )
}

/// Right up to a frame, and shifted by a fixed number from there on.
fn from_a_frame_on(pairs: &Pairs, found: &[usize]) -> Option<String> {
    let first = found.iter().enumerate().position(|(i, j)| i != *j)?;
    if !(0..first).all(|i| is_right(pairs, found, i)) {
        return None;
    }
    let shift = found[first] as i64 - first as i64;
    // At the end the frames that would be needed are not there.
    let rest = (first..found.len()).filter(|i| (*i as i64 + shift) < found.len() as i64);
    if !rest.clone().all(|i| found[i] as i64 - i as i64 == shift) || rest.count() < 2 {
        return None;
    }
    let at = pairs.indices[first];
    let n = shift.unsigned_abs();
    let were = counted(n as usize, "frame was", "frames were");
    let what =
        if shift > 0 { format!("{were} dropped") } else { format!("{were} put in or stand there twice") };
    Some(format!("from frame {at} on the real frames are those of other times by {n}: {what} before it"))
}

/// Single frames that show something else.
pub(super) fn strangers(pairs: &Pairs) -> Option<String> {
    let own: Vec<f64> = pairs.real.iter().zip(&pairs.simulated).map(|(r, s)| r.unlike(s)).collect();
    let usual = median(own.clone());
    if usual > 0.3 {
        return None;
    }
    let nowhere = |i: usize| pairs.simulated.iter().all(|s| pairs.real[i].unlike(s) > 0.4);
    let strange: Vec<usize> =
        (0..own.len()).filter(|&i| own[i] > 0.5 && own[i] > 4.0 * usual && nowhere(i)).collect();
    if strange.is_empty() || 3 * strange.len() > own.len() {
        return None;
    }
    let names = listed(strange.iter().map(|&i| pairs.indices[i]));
    Some(format!(
        "real frame {names} shows another scene than the simulation, and than the other real frames"
    ))
}

/// Single frames that are not what the camera of the others makes.
pub(super) fn apart(odd: &Odd, evidence: &Evidence) -> String {
    let names = listed(odd.frames.iter().map(|(at, _)| evidence.frames[*at].index));
    let most = odd.frames.iter().filter_map(|(_, off)| *off).fold(0.0, f64::max);
    let far = match most > 0.0 {
        true => format!("{most:.1} DN from what the camera of the others makes"),
        false => "something else in most of the picture".to_owned(),
    };
    format!(
        "real frame {names} is unlike the others: {far}, where the others are {:.1} DN away (another exposure, \
         colour order or encoding, a shift, a blur in that frame alone?)",
        odd.usual_dn.max(0.0)
    )
}

/// Neighbours that are the same to the last bit while the camera moves.
pub(super) fn repeated(pairs: &Pairs, evidence: &Evidence) -> Option<String> {
    let same = |i: &usize| {
        evidence.frames[*i].dn.data == evidence.frames[*i - 1].dn.data
            && pairs.simulated[*i].unlike(&pairs.simulated[*i - 1]) > ALIKE
    };
    let again: Vec<usize> = (1..evidence.frames.len()).filter(same).collect();
    if again.is_empty() {
        return None;
    }
    let names = listed(again.iter().map(|&i| pairs.indices[i]));
    Some(format!(
        "real frame {names} is a copy of the one before it, to the last bit, though the camera moves"
    ))
}

pub(super) fn listed(indices: impl ExactSizeIterator<Item = usize>) -> String {
    let more = indices.len().saturating_sub(MOST_LISTED);
    let names: Vec<_> = indices.take(MOST_LISTED).map(|i| i.to_string()).collect();
    if more > 0 { format!("{} and {more} more", names.join(", ")) } else { names.join(", ") }
}
