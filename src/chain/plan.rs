//! The flat list of dispatches that settings ask for.

use super::pack::pointwise;
use super::{Domain, Effect, Settings, Stage, Work, slot_of};
use crate::error::{Error, Result};

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
    },
}

/// What settings ask for: equal plans share their pipelines.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Plan {
    /// The dispatches, in light-path order.
    pub steps: Vec<Step>,
}

impl Plan {
    /// The dispatches of the effects that are not neutral; with `floats` the last one writes a picture of floats too.
    pub fn new(list: &[&dyn Effect], settings: &Settings, floats: bool) -> Self {
        let empty = vec![0; pointwise(list).count()];
        let (mut steps, mut open) = (Vec::new(), empty.clone());
        let close = |open: &mut Vec<u32>, steps: &mut Vec<Step>| {
            if open.iter().any(|v| *v != 0) {
                let variants = std::mem::replace(open, empty.clone());
                steps.push(Step::Pointwise { variants, last: false });
            }
        };
        for effect in list {
            let variant = effect.variant(settings);
            match effect.work() {
                _ if variant == 0 => {}
                Work::Pointwise(_) => {
                    if effect.reads_neighbours(settings) {
                        close(&mut open, &mut steps);
                    }
                    open[slot_of(list, effect.id())] = variant;
                }
                Work::Neighbourhood { passes, .. } => {
                    close(&mut open, &mut steps);
                    let slot = slot_of(list, effect.id()) as u32;
                    let step = |(pass, p): (usize, super::Pass)| Step::Neighbourhood {
                        id: effect.id(),
                        slot,
                        pass,
                        file: p.file,
                        constants: p.constants,
                        run: p.run,
                    };
                    steps.extend(passes(settings).into_iter().enumerate().map(step));
                }
                Work::Elsewhere | Work::Host(_) => {}
            }
        }
        steps.push(Step::Pointwise { variants: open, last: !floats });
        Self { steps }
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
