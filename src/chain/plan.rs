//! The flat list of dispatches that settings ask for.

use super::pack::pointwise;
use super::{Domain, Effect, Settings, Stage, Work, slot_of};
use crate::error::{Error, Result};

/// First specialization constant of a pass of its own; before it are those of the fused effects.
pub const PASS_CONSTANTS: usize = 50;

/// One dispatch.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// `pointwise.comp`: the variant of each of its effects, 0 where it is left out; the last one writes the delivered
    /// picture.
    Pointwise {
        /// By place in the fused kernel.
        variants: Vec<u32>,
        /// Whether it writes 8-bit pixels instead of a picture of floats.
        last: bool,
    },
    /// One pass of an effect that reads its neighbours.
    Neighbourhood {
        /// The effect.
        id: &'static str,
        /// Its slot of parameters.
        slot: u32,
        /// Which of its passes, from 0.
        pass: usize,
        /// File name of the kernel.
        file: &'static str,
        /// Its specialization constants.
        constants: [u32; 2],
        /// Columns and rows that one invocation makes.
        run: [u32; 2],
        /// The variants of the fused effects that it runs on what it has made; empty: it runs none.
        tail: Vec<u32>,
        /// As for `Pointwise`.
        last: bool,
    },
}

impl Step {
    /// Takes in the fused effects that follow, if it is a pass that can.
    fn absorb(&mut self, variants: &[u32], delivers: bool) -> bool {
        match self {
            Self::Neighbourhood { tail, last, .. } => {
                *tail = variants.to_vec();
                *last = delivers;
                true
            }
            Self::Pointwise { .. } => false,
        }
    }

    /// Whether it writes 8-bit pixels.
    pub fn delivers(&self) -> bool {
        match self {
            Self::Pointwise { last, .. } | Self::Neighbourhood { last, .. } => *last,
        }
    }

    /// Its specialization constants, from 0.
    pub fn constants(&self) -> Vec<u32> {
        let (variants, own) = match self {
            Self::Pointwise { variants, .. } => (variants, [0; 2]),
            Self::Neighbourhood { tail, constants, .. } => (tail, *constants),
        };
        let mut all = vec![0; PASS_CONSTANTS + own.len()];
        all[0] = u32::from(self.delivers());
        all[1..=variants.len()].copy_from_slice(variants);
        all[PASS_CONSTANTS..].copy_from_slice(&own);
        all
    }
}

/// What is wanted of a chain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wanted {
    /// The delivered picture, 8 bits a value.
    pub pixels: bool,
    /// Its encoded values before they are rounded.
    pub values: bool,
    /// What the converter delivers, before the mosaic's other colours are filled in.
    pub raw: bool,
}

impl Wanted {
    /// The delivered picture alone.
    pub const PIXELS: Self = Self { pixels: true, values: false, raw: false };
    /// The encoded values alone.
    pub const VALUES: Self = Self { pixels: false, values: true, raw: false };
}

/// What settings ask for: equal plans share their pipelines.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Plan {
    /// The dispatches, in light-path order.
    pub steps: Vec<Step>,
    /// How many of them make the encoded values, if those are wanted.
    pub values_behind: Option<usize>,
    /// How many of them make what the converter delivers, if that is wanted.
    pub raw_behind: Option<usize>,
}

/// Dispatches so far, and the fused effects of the one that is still open.
struct Making {
    steps: Vec<Step>,
    open: Vec<u32>,
    empty: Vec<u32>,
    /// Whether the first of the open effects looks at the picture that a pass before it makes.
    looks: bool,
    /// What so many steps made is kept: what follows is none of theirs.
    kept: usize,
}

impl Making {
    /// Ends the open dispatch; the `last` one is there even where nothing is open.
    fn close(&mut self, last: bool, delivers: bool) {
        let variants = std::mem::replace(&mut self.open, self.empty.clone());
        let looks = std::mem::take(&mut self.looks);
        if !last && variants.iter().all(|v| *v == 0) {
            return;
        }
        let free = self.steps.len() > self.kept && !looks;
        if !free || !self.steps.last_mut().is_some_and(|step| step.absorb(&variants, delivers)) {
            self.steps.push(Step::Pointwise { variants, last: delivers });
        }
    }

    /// Ends the open dispatch; what is there then is read back.
    fn keep(&mut self) -> usize {
        self.close(false, false);
        self.kept = self.steps.len();
        self.kept
    }
}

impl Plan {
    /// The dispatches of the effects that are not neutral. Where pixels are not wanted, the last one makes the values.
    pub fn new(list: &[&dyn Effect], settings: &Settings, wanted: Wanted) -> Self {
        let empty = vec![0; pointwise(list).count()];
        let mut making = Making { steps: Vec::new(), open: empty.clone(), empty, looks: false, kept: 0 };
        let mut raw_behind = None;
        for effect in list {
            if wanted.raw && effect.fills_mosaic() {
                raw_behind = Some(making.keep());
            }
            let variant = effect.variant(settings);
            match effect.work() {
                _ if variant == 0 => {}
                Work::Pointwise(_) => {
                    if effect.reads_neighbours(settings) {
                        making.close(false, false);
                        making.looks = true;
                    }
                    making.open[slot_of(list, effect.id())] = variant;
                }
                Work::Neighbourhood { passes, .. } => {
                    making.close(false, false);
                    let slot = slot_of(list, effect.id()) as u32;
                    let step = |(pass, p): (usize, super::Pass)| Step::Neighbourhood {
                        id: effect.id(),
                        slot,
                        pass,
                        file: p.file,
                        constants: p.constants,
                        run: p.run,
                        tail: Vec::new(),
                        last: false,
                    };
                    making.steps.extend(passes(settings).into_iter().enumerate().map(step));
                }
                Work::Elsewhere | Work::Host(_) => {}
            }
        }
        // The values first: what rounds them to pixels then is a dispatch without effects.
        let values_behind = (wanted.values && wanted.pixels).then(|| making.keep());
        making.close(true, wanted.pixels);
        let values_behind = values_behind.or(wanted.values.then_some(making.steps.len()));
        Self { steps: making.steps, values_behind, raw_behind }
    }
}

/// Checks that the order of a list makes sense: domains only go forward (noise is never added to encoded values), end
/// encoded, and effects that act elsewhere do not stand behind those that act on pixels.
///
/// # Errors
/// The first effect that stands in the wrong place.
pub fn check_order(list: &[&dyn Effect]) -> Result<()> {
    let mut reached = Domain::LinearRgb;
    let mut last_of_pixels = None;
    for effect in list {
        let wrong = |needs: String| {
            Err(Error::ChainOrder { effect: effect.id(), needs, reached: format!("{reached:?}") })
        };
        match effect.stage() {
            Stage::Pixel(from, to) if from < reached || to < from => return wrong(format!("{from:?}")),
            Stage::Pixel(_, to) => (reached, last_of_pixels) = (to, Some(effect.id())),
            Stage::Geometry | Stage::Time if last_of_pixels.is_some() => {
                return wrong("the scene".to_owned());
            }
            Stage::Geometry | Stage::Time | Stage::SetUp => {}
        }
    }
    match last_of_pixels {
        Some(_) if reached == Domain::EncodedRgb => Ok(()),
        _ => Err(Error::ChainOrder {
            effect: last_of_pixels.unwrap_or("the empty list"),
            needs: format!("{:?} behind it", Domain::EncodedRgb),
            reached: format!("{reached:?}"),
        }),
    }
}
