//! Whether all frames show one scene: pairs alone do not tell, as two pairs of two scenes are at rest in themselves.

use super::frames::{Encoding, Frame};
use super::statics::{AlignedPair, align};
use shutterbug::error::{Error, Result};

/// What all frames are to the first one.
#[derive(Clone, Debug)]
pub(super) struct Together {
    /// Pixels at which nothing moved in any frame; `None` where a frame is displaced.
    pub resting: Option<Vec<bool>>,
    /// Files of the frames that are displaced against the first.
    pub moved: Vec<String>,
}

/// Aligns the frames two by two for the measurement, and all of them with the first.
///
/// # Errors
/// A pair that is no static scene; frames of which some show another scene than the rest.
pub(super) fn one_scene(frames: &[Frame], encoding: Encoding) -> Result<(Vec<AlignedPair>, Together)> {
    let mut pairs = Vec::new();
    let mut together =
        Together { resting: Some(vec![true; frames[0].encoded.data.len() / 3]), moved: Vec::new() };
    let named = |k: usize| frames[k].path.display().to_string();
    let mut others: Vec<(usize, Error)> = Vec::new();
    for k in 1..frames.len() {
        match align(&frames[0], &frames[k], encoding) {
            Ok(with_first) => {
                together.add(&with_first, named(k));
                if k == 1 {
                    pairs.push(with_first);
                }
            }
            Err(error) => others.push((k, error)),
        }
    }
    if !others.is_empty() {
        return Err(another(frames, others, encoding));
    }
    for pair in frames.chunks_exact(2).skip(1) {
        pairs.push(align(&pair[0], &pair[1], encoding)?);
    }
    Ok((pairs, together))
}

impl Together {
    fn add(&mut self, pair: &AlignedPair, name: String) {
        if pair.registration.moved {
            self.moved.push(name);
            self.resting = None;
        } else if let Some(resting) = &mut self.resting {
            resting.iter_mut().zip(&pair.usable).for_each(|(all, own)| *all &= own);
        }
    }
}

/// Names the frames that differ from the most. `others` are those that differ from the first; where they are the most
/// and agree, it is the first that is another's.
fn another(frames: &[Frame], mut others: Vec<(usize, Error)>, encoding: Encoding) -> Error {
    if others.len() > 1 && 2 * others.len() > frames.len() {
        let of = others[0].0;
        let alike = |k: usize| k == of || align(&frames[of], &frames[k], encoding).is_ok();
        let differ: Vec<usize> = (0..frames.len()).filter(|k| !alike(*k)).collect();
        if differ.len() < others.len() {
            let why = |k| align(&frames[of], &frames[k], encoding).map(|_| ()).expect_err("it differs");
            others = differ.into_iter().map(|k| (k, why(k))).collect();
        }
    }
    let names: Vec<String> = others[1..].iter().map(|(k, _)| frames[*k].path.display().to_string()).collect();
    match others.swap_remove(0).1 {
        Error::Input { path, line, found, expected } if frames.len() > 2 => {
            let more =
                if names.is_empty() { String::new() } else { format!(" (and so with {})", names.join(", ")) };
            let expected = format!("{expected}, as of all frames; --pairs takes each pair for itself");
            Error::Input { path, line, found: format!("{found}{more}"), expected }
        }
        error => error,
    }
}
