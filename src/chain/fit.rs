//! The line of a parameter that says how a diagnosis finds it and how a blind trial hides it. Name, unit, range and
//! neutral value stand in [`super::ParamSpec`] and nowhere else.

/// What a fit holds in place of a parameter's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// The value; the place of a choice among its options; the components of a vector.
    Itself,
    /// One over the value, and 0 for none: what grows with the effect and has no end.
    Inverse,
    /// The value times the cosine of the parameter behind it, which holds the sine ([`Held::Sine`]): near no depth a
    /// phase has no slope, these two have.
    Cosine,
    /// See [`Held::Cosine`].
    Sine,
    /// Nothing: the choice stands beside the numbers of the fit (which line is read first).
    Aside,
}

/// How a parameter is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// What the fit holds.
    pub held: Held,
    /// Step of numeric derivatives, by component of a vector: moves a typical picture by a few tenths of a px or of a
    /// DN to a few DN.
    pub step: [f64; 3],
    /// What fits look through, of what is held; nothing: the parameter's whole range.
    pub range: Option<[f64; 2]>,
    /// What is held while the effect is off, if that is not the neutral value: of parameters that mean nothing then.
    pub rest: Option<f64>,
    /// Freed at the end only, if that helps.
    pub last: bool,
    /// The ends of its range are values like others (a veil may be black or white), no sign that the truth lies beyond.
    pub ends: bool,
    /// Frames whose lines are all exposed at once tell it up to multiples of their own rate only.
    pub by_lines: bool,
    /// Where fits begin, one after another together with those of the effect's other parameters; of parameters in s in
    /// units of the time from frame to frame. Empty: where they are.
    pub starts: &'static [f64],
    /// How a blind trial hides it.
    pub trial: Option<Trial>,
}

impl Fit {
    /// A fit whose numeric derivatives take that step.
    pub const fn by(step: f64) -> Self {
        Self {
            held: Held::Itself,
            step: [step; 3],
            range: None,
            rest: None,
            last: false,
            ends: false,
            by_lines: false,
            starts: &[],
            trial: None,
        }
    }

    /// One that finds a choice: options are tried, no derivative is taken.
    pub const fn choice() -> Self {
        Self::by(1.0)
    }

    /// The same, looking through that range only.
    pub const fn within(self, least: f64, most: f64) -> Self {
        Self { range: Some([least, most]), ..self }
    }

    /// The same, holding something else.
    pub const fn held(self, held: Held) -> Self {
        Self { held, ..self }
    }

    /// The same, with that value while the effect is off.
    pub const fn rest(self, rest: f64) -> Self {
        Self { rest: Some(rest), ..self }
    }

    /// The same, of which the ends of the range are values like others.
    pub const fn ends(self) -> Self {
        Self { ends: true, ..self }
    }

    /// The same, freed at the end only.
    pub const fn last(self) -> Self {
        Self { last: true, ..self }
    }

    /// The same, known by lines only.
    pub const fn by_lines(self) -> Self {
        Self { by_lines: true, ..self }
    }

    /// The same, beginning there.
    pub const fn starts(self, starts: &'static [f64]) -> Self {
        Self { starts, ..self }
    }

    /// The same, hidden by blind trials: by that law, in that range.
    pub const fn trial(self, law: Law, least: f64, most: f64) -> Self {
        Self { trial: Some(Trial { law, blind: [least, most], graded: None }), ..self }
    }

    /// The same, graded from what nobody sees at 160x120 to what anybody does.
    ///
    /// # Panics
    /// Without [`Fit::trial`] before it, when the program is compiled.
    pub const fn graded(self, least: f64, most: f64) -> Self {
        let trial = match self.trial {
            Some(trial) => trial,
            None => panic!("what is graded is hidden"),
        };
        Self { trial: Some(Trial { graded: Some([least, most]), ..trial }), ..self }
    }
}

/// What a strength is to the value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Neutral plus the strength.
    Up,
    /// Neutral less the strength.
    Down,
    /// Either of the two.
    Either,
    /// One of the factors `exp(strength)` and `exp(-strength)`.
    Factor,
    /// One over the square of the strength: electrons, of the noise that they make.
    Electrons,
    /// The strength, drawn evenly and not in equal ratios: of parameters that say how, not how much.
    Even,
    /// As `Even`, a whole number; graded it is 100 less the strength.
    Coarser,
    /// A vector of that length in any direction.
    Direction,
    /// As `Even`: a place in the list of options, 0..1, what lies below 0 being the first.
    Option,
    /// As `Even`: that many times what the parameter before it is off its neutral value.
    Follows,
}

/// How a blind trial hides a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// From strength to value.
    pub law: Law,
    /// Strengths between "an attentive person may see it" and "a bad camera"; of places in a list, where they lie.
    pub blind: [f64; 2],
    /// Weakest and strongest where effects are graded.
    pub graded: Option<[f64; 2]>,
}
