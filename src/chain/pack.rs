//! Parameters of all effects for one frame, as kernels read them. Twin of `glsl/include/chain.glsl`.

use super::{Effect, Settings, View, Work};

/// Rows of four words that an effect has for its parameters.
pub const SLOT_ROWS: usize = 16;
/// Rows of the kernels' uniform block.
const MAX_ROWS: usize = 1024;
/// Its size; Vulkan promises that so much can be bound.
pub const PARAMETER_BYTES: u64 = 16 * MAX_ROWS as u64;
/// Number of parameters that fit in a slot.
const SLOT_WORDS: usize = 4 * SLOT_ROWS;

/// The effects that the fused kernel holds, in the list's order: that of `glsl/include/effects/list.glsl`.
pub(super) fn pointwise<'a>(list: &'a [&dyn Effect]) -> impl Iterator<Item = &'static str> + 'a {
    list.iter().filter(|e| matches!(e.work(), Work::Pointwise(_))).map(|e| e.id())
}

/// The slot of an effect: its place in the fused kernel, or behind all of those its place in `list`.
///
/// # Panics
/// If the effect is not in `list`.
pub fn slot_of(list: &[&dyn Effect], id: &str) -> usize {
    pointwise(list).position(|stem| stem == id).unwrap_or_else(|| {
        let place = list.iter().position(|e| e.id() == id).expect("an effect of the list");
        pointwise(list).count() + place
    })
}

/// What the kernels of a frame are given.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    /// The uniform block: [`SLOT_ROWS`] rows a slot.
    pub rows: Vec<[u32; 4]>,
    /// The tables that parameters point into.
    pub tables: Vec<u32>,
}

impl Packed {
    /// Packs the effects of `list` that are not neutral.
    ///
    /// # Panics
    /// If the list has more effects than fit into the uniform block: a bug that any test of the chain finds.
    pub fn new(list: &[&dyn Effect], settings: &Settings, view: &View) -> Self {
        let mut packed = Self { rows: vec![[0; 4]; MAX_ROWS], tables: Vec::new() };
        let slots = pointwise(list).count() + list.len();
        assert!(SLOT_ROWS * slots <= MAX_ROWS, "too many effects for the uniform block");
        for effect in list.iter().filter(|e| e.variant(settings) != 0) {
            let first = SLOT_ROWS * slot_of(list, effect.id());
            let rows = &mut packed.rows[first..first + SLOT_ROWS];
            effect.pack(settings, view, &mut Packer { rows, used: 0, tables: &mut packed.tables });
        }
        packed
    }

    /// The parameters of an effect.
    pub fn parameters(&self, slot: usize) -> Parameters<'_> {
        Parameters { rows: &self.rows[SLOT_ROWS * slot..SLOT_ROWS * (slot + 1)], tables: &self.tables }
    }

    /// Most words that tables can have in a picture of that size: sixteen a line of either direction, two bits a pixel,
    /// and the weights of the widest neighbourhoods.
    pub fn table_capacity(size: [u32; 2]) -> usize {
        let [width, height] = size.map(|s| s as usize);
        16 * (width + height) + width * height / 16 + 8192
    }
}

/// Takes the parameters of one effect, one after another.
pub struct Packer<'a> {
    rows: &'a mut [[u32; 4]],
    used: usize,
    tables: &'a mut Vec<u32>,
}

impl Packer<'_> {
    /// A number.
    pub fn number(&mut self, value: f64) {
        self.bits((value as f32).to_bits());
    }

    /// A whole number.
    ///
    /// # Panics
    /// If the slot is full: a bug of the effect.
    pub fn bits(&mut self, value: u32) {
        assert!(self.used < SLOT_WORDS, "an effect has at most {SLOT_WORDS} parameters");
        self.rows[self.used / 4][self.used % 4] = value;
        self.used += 1;
    }

    /// The two words of a seed, low word first.
    pub fn seed(&mut self, seed: u64) {
        super::rng::seed_words(seed).into_iter().for_each(|word| self.bits(word));
    }

    /// A table of numbers; the parameter is the place of its first.
    pub fn table(&mut self, values: impl IntoIterator<Item = f32>) {
        self.words(values.into_iter().map(f32::to_bits));
    }

    /// A table of rows of four numbers; the parameter is the row of its first.
    pub fn rows(&mut self, rows: impl IntoIterator<Item = [f32; 4]>) {
        self.tables.resize(self.tables.len().next_multiple_of(4), 0);
        self.bits(self.tables.len() as u32 / 4);
        self.tables.extend(rows.into_iter().flatten().map(f32::to_bits));
    }

    /// A table of words; the parameter is the place of its first.
    pub fn words(&mut self, values: impl IntoIterator<Item = u32>) {
        let first = self.tables.len() as u32;
        self.bits(first);
        self.tables.extend(values);
    }
}

/// The parameters of one effect.
#[derive(Clone, Copy, Debug)]
pub struct Parameters<'a> {
    rows: &'a [[u32; 4]],
    tables: &'a [u32],
}

impl Parameters<'_> {
    /// Parameter `index` as bits.
    pub fn bits(&self, index: usize) -> u32 {
        self.rows[index / 4][index % 4]
    }

    /// Parameter `index` as a number.
    pub fn number(&self, index: usize) -> f32 {
        f32::from_bits(self.bits(index))
    }

    /// Entry `place` of the table that parameter `index` points to, as bits.
    pub fn word(&self, index: usize, place: usize) -> u32 {
        self.tables[self.bits(index) as usize + place]
    }

    /// Row `place` of the table of rows that parameter `index` points to.
    pub fn row(&self, index: usize, place: usize) -> [f32; 4] {
        let first = 4 * (self.bits(index) as usize + place);
        [0, 1, 2, 3].map(|i| f32::from_bits(self.tables[first + i]))
    }

    /// Entry `place` of the table that parameter `index` points to, as a number.
    pub fn table(&self, index: usize, place: usize) -> f32 {
        f32::from_bits(self.word(index, place))
    }
}
