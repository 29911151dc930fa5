//! Digital numbers as raw pictures hold them: in words of 16 bits, or packed as MIPI CSI-2 sends them.

/// How the digital numbers of a row lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawLayout {
    /// One number of so many bits (at most 16) in the low bits of each little-endian word of 16.
    Words(u32),
    /// RAW10: the high 8 bits of four pixels, then a byte with the low 2 bits of each, the first pixel's lowest.
    Mipi10,
    /// RAW12: the high 8 bits of two pixels, then a byte with the low 4 bits of each, the first pixel's lowest.
    Mipi12,
    /// RAW14: the high 8 bits of four pixels, then three bytes with the low 6 bits of each, little-endian, the first
    /// pixel's lowest.
    Mipi14,
}

impl RawLayout {
    /// Bits of a number.
    pub fn bits(self) -> u32 {
        match self {
            Self::Words(bits) => bits,
            Self::Mipi10 => 10,
            Self::Mipi12 => 12,
            Self::Mipi14 => 14,
        }
    }

    /// Pixels that lie together, and the bytes that they take.
    pub fn group(self) -> [usize; 2] {
        match self {
            Self::Words(_) => [1, 2],
            Self::Mipi10 => [4, 5],
            Self::Mipi12 => [2, 3],
            Self::Mipi14 => [4, 7],
        }
    }

    /// Writes a row of values, 1 = the largest number.
    ///
    /// # Panics
    /// If the row is no whole number of groups, or `to` is shorter than they are.
    pub fn put(self, values: &[f32], to: &mut [u8]) {
        let [pixels, bytes] = self.group();
        assert!(values.len().is_multiple_of(pixels), "{} px in groups of {pixels}", values.len());
        let to = &mut to[..values.len() / pixels * bytes];
        let low = self.bits().saturating_sub(8);
        for (values, to) in values.chunks_exact(pixels).zip(to.chunks_exact_mut(bytes)) {
            if let Self::Words(bits) = self {
                to.copy_from_slice(&digital_number(values[0], bits).to_le_bytes());
                continue;
            }
            let mut rest = 0u32;
            for (i, value) in values.iter().enumerate() {
                let number = u32::from(digital_number(*value, self.bits()));
                to[i] = (number >> low) as u8;
                rest |= (number & ((1 << low) - 1)) << (low * i as u32);
            }
            to[pixels..].copy_from_slice(&rest.to_le_bytes()[..bytes - pixels]);
        }
    }
}

/// A value as a number of `bits` bits (at most 16), 1 = the largest; clipped, and 0 for what is no number.
pub fn digital_number(value: f32, bits: u32) -> u16 {
    let largest = f64::from((1u32 << bits) - 1);
    (f64::from(value).clamp(0.0, 1.0) * largest + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [RawLayout; 7] = [
        RawLayout::Words(10),
        RawLayout::Words(12),
        RawLayout::Words(14),
        RawLayout::Words(16),
        RawLayout::Mipi10,
        RawLayout::Mipi12,
        RawLayout::Mipi14,
    ];

    /// As the tables of CSI-2 (and of V4L2's `SRGGB10P`, `12P`, `14P`) name the bits: (byte, lowest bit there, pixel,
    /// lowest bit of the number, how many). Written down apart from `put`.
    fn table(layout: RawLayout) -> Vec<(usize, u32, usize, u32, u32)> {
        match layout {
            RawLayout::Words(bits) => vec![(0, 0, 0, 0, 8), (1, 0, 0, 8, bits - 8)],
            RawLayout::Mipi10 => {
                let high = (0..4).map(|p| (p, 0, p, 2, 8));
                high.chain([(4, 0, 0, 0, 2), (4, 2, 1, 0, 2), (4, 4, 2, 0, 2), (4, 6, 3, 0, 2)]).collect()
            }
            RawLayout::Mipi12 => vec![(0, 0, 0, 4, 8), (1, 0, 1, 4, 8), (2, 0, 0, 0, 4), (2, 4, 1, 0, 4)],
            RawLayout::Mipi14 => {
                let high = (0..4).map(|p| (p, 0, p, 6, 8));
                let low = [
                    (4, 0, 0, 0, 6),
                    (4, 6, 1, 0, 2),
                    (5, 0, 1, 2, 4),
                    (5, 4, 2, 0, 4),
                    (6, 0, 2, 4, 2),
                    (6, 2, 3, 0, 6),
                ];
                high.chain(low).collect()
            }
        }
    }

    /// Numbers of a row, by the table.
    fn numbers(layout: RawLayout, bytes: &[u8]) -> Vec<u32> {
        let [pixels, group] = layout.group();
        let one = |bytes: &[u8]| {
            let mut all = vec![0; pixels];
            for (byte, at, pixel, of, bits) in table(layout) {
                all[pixel] |= (u32::from(bytes[byte]) >> at & ((1 << bits) - 1)) << of;
            }
            all
        };
        bytes.chunks_exact(group).flat_map(one).collect()
    }

    #[test]
    fn every_number_lies_where_the_tables_say() {
        for layout in ALL {
            let bits = layout.bits();
            let largest = (1u32 << bits) - 1;
            // All numbers, in an order in which neighbours differ in all bits.
            let want: Vec<u32> = (0..=largest).map(|i| i.wrapping_mul(40503) & largest).collect();
            let values: Vec<f32> = want.iter().map(|n| *n as f32 / largest as f32).collect();
            let [pixels, group] = layout.group();
            let mut bytes = vec![0xa5; want.len() / pixels * group];
            layout.put(&values, &mut bytes);
            assert!(numbers(layout, &bytes) == want, "{layout:?}");
            // Control: two pixels of a group exchanged, or rows of another layout, are something else.
            if pixels > 1 {
                let mut other = bytes.clone();
                layout.put(&values.iter().copied().rev().collect::<Vec<_>>(), &mut other);
                assert!(numbers(layout, &other) != want, "{layout:?}");
            }
        }
        let mut bytes = [0; 5];
        RawLayout::Mipi10.put(&[1.0, 0.0, 0.0, 1.0 / 1023.0], &mut bytes);
        assert_eq!(bytes, [255, 0, 0, 0, 0b0100_0011]);
    }

    #[test]
    fn what_is_no_number_of_the_converter_is_clipped() {
        let of = |v| digital_number(v, 12);
        assert_eq!([of(-0.3), of(f32::NAN), of(f32::INFINITY), of(1.2)], [0, 0, 4095, 4095]);
        assert_eq!([of(0.4999 / 4095.0), of(0.5001 / 4095.0)], [0, 1]);
    }
}
