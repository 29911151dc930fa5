//! Timestamps, exact to the nanosecond. A time since 1970 has 19 digits in ns; an `f64` keeps 16 of them. So a stamp
//! stays an integer until the capture's epoch is subtracted, and only the small difference becomes an `f64`.

/// An instant: `ns + fraction_ns` nanoseconds on the clock of the file that it stands in.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Stamp {
    /// Whole nanoseconds, rounded towards zero.
    pub ns: i64,
    /// The rest, in (-1, 1) ns with the sign of the whole.
    pub fraction_ns: f64,
}

/// Why a text is no time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampFault {
    /// Not a finite decimal number.
    NotANumber,
    /// Further from zero than 2^63 ns (292 years): most likely ns where s are meant.
    TooFar,
}

impl Stamp {
    /// The instant `ns` nanoseconds after zero.
    pub fn from_ns(ns: i64) -> Self {
        Self { ns, fraction_ns: 0.0 }
    }

    /// Reads a decimal number of seconds (`1403636579.758555392`, `1.7e9`), with no rounding of the nanoseconds.
    ///
    /// # Errors
    /// A text that is not a decimal number, or is too far from zero.
    pub fn parse_seconds(text: &str) -> Result<Self, StampFault> {
        let (negative, digits, point) = split_decimal(text).ok_or(StampFault::NotANumber)?;
        // In nanoseconds the point stands nine digits further to the right.
        let point = point + 9;
        let whole = usize::try_from(point).unwrap_or(0);
        if !digits.is_empty() && whole > 19 {
            return Err(StampFault::TooFar);
        }
        let mut ns: i128 = 0;
        for digit in
            digits.bytes().map(|b| i128::from(b - b'0')).chain(std::iter::repeat(0)).take(whole.min(19))
        {
            ns = 10 * ns + digit;
        }
        let ns = i64::try_from(ns).map_err(|_| StampFault::TooFar)?;
        // Digits finer than a ns; 40 zeros after the point are far below what an f64 can add to a ns.
        let zeros = usize::try_from(-point).unwrap_or(0).min(40);
        let rest: String = digits.get(whole..).unwrap_or_default().chars().take(40).collect();
        let fraction_ns: f64 =
            format!("0.{}{rest}0", "0".repeat(zeros)).parse().expect("digits are a number");
        // 0.999...9 with more nines than an f64 holds rounds to 1, which is the next whole nanosecond's.
        let fraction_ns = fraction_ns.min(1.0 - f64::EPSILON / 2.0);
        let sign = if negative { -1 } else { 1 };
        Ok(Self { ns: sign * ns, fraction_ns: f64::from(sign as i32) * fraction_ns })
    }

    /// Seconds from `epoch_ns` to this instant: exact to 0.1 ns over a hundred days.
    pub fn seconds_since(self, epoch_ns: i64) -> f64 {
        ((i128::from(self.ns) - i128::from(epoch_ns)) as f64 + self.fraction_ns) / 1e9
    }
}

/// Sign, digits without leading zeros, and how many of them (or, negative, how many zeros before them) make up the
/// point's place: the value is `0.digits * 10^point`.
fn split_decimal(text: &str) -> Option<(bool, String, i64)> {
    let (negative, text) = match text.as_bytes().first()? {
        b'-' => (true, &text[1..]),
        b'+' => (false, &text[1..]),
        _ => (false, text),
    };
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, parse_exponent(exponent)?),
        None => (text, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let all_digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if whole.len() + fraction.len() == 0 || !all_digits(whole) || !all_digits(fraction) {
        return None;
    }
    let digits = format!("{whole}{fraction}");
    let significant = digits.trim_start_matches('0');
    let point = whole.len() as i64 - (digits.len() - significant.len()) as i64 + exponent;
    Some((negative, significant.to_owned(), point))
}

/// An exponent, held within +-10^9: beyond that every value is zero or too far anyway.
fn parse_exponent(text: &str) -> Option<i64> {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let size = digits.parse::<i64>().unwrap_or(i64::MAX).min(1_000_000_000);
    Some(if text.starts_with('-') { -size } else { size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Stamp {
        Stamp::parse_seconds(text).unwrap_or_else(|e| panic!("{text}: {e:?}"))
    }

    #[test]
    fn nineteen_digits_keep_their_nanoseconds() {
        assert_eq!(parse("1700000000.123456789").ns, 1_700_000_000_123_456_789);
        // Control: by way of an f64 the same stamp loses them.
        let through_f64 = ("1700000000.123456789".parse::<f64>().expect("a number") * 1e9) as i64;
        assert_ne!(through_f64, 1_700_000_000_123_456_789);
        let later = parse("1700000000.123456790");
        assert_eq!(later.seconds_since(1_700_000_000_123_456_789), 1e-9);
    }

    #[test]
    fn other_spellings_mean_the_same() {
        for text in [
            "1.5",
            "+1.5",
            "01.50",
            "1500e-3",
            "0.0015E3",
            "15e-1",
            "0.15e+1",
            "1.5e0",
            "1.5000000000000000000",
        ] {
            assert_eq!(parse(text), Stamp::from_ns(1_500_000_000), "{text}");
        }
        assert_eq!(parse("1.403636579758555392e9").ns, 1_403_636_579_758_555_392);
        assert_eq!(parse("-0.25").ns, -250_000_000);
        assert_eq!(parse("0"), Stamp::from_ns(0));
        assert_eq!(parse("0e999999999999"), Stamp::from_ns(0));
        assert_eq!(parse("1e-999999999999").ns, 0);
        assert_eq!(parse("5."), Stamp::from_ns(5_000_000_000));
        assert_eq!(parse(".5"), Stamp::from_ns(500_000_000));
    }

    #[test]
    fn digits_finer_than_a_nanosecond_are_kept() {
        assert_eq!(parse("0.0000000012"), Stamp { ns: 1, fraction_ns: 0.2 });
        assert_eq!(parse("-0.0000000012"), Stamp { ns: -1, fraction_ns: -0.2 });
        assert_eq!(parse("1e-10"), Stamp { ns: 0, fraction_ns: 0.1 });
        assert!(parse("1.0000000005") > parse("1.0000000004"));
        assert!(parse("-1.0000000005") < parse("-1.0000000004"));
        assert!(parse("0.00000000099999999999999999999999") < parse("1e-9"));
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for text in [
            "", "-", ".", "e5", "1e", "1e+", "nan", "inf", "-inf", "1.2.3", "1,5", "0x10", "1_000", "1e5.5",
            "--1",
        ] {
            assert_eq!(Stamp::parse_seconds(text), Err(StampFault::NotANumber), "{text}");
        }
        for text in ["1403636579758555392", "9223372036.854775808", "1e11", "1e999999999999"] {
            assert_eq!(Stamp::parse_seconds(text), Err(StampFault::TooFar), "{text}");
        }
        assert_eq!(parse("9223372036.854775807").ns, i64::MAX);
    }

    proptest! {
        #[test]
        fn every_nanosecond_survives(ns: i64) {
            prop_assume!(ns != i64::MIN);
            let sign = if ns < 0 { "-" } else { "" };
            let text = format!("{sign}{}.{:09}", ns.unsigned_abs() / 1_000_000_000, ns.unsigned_abs() % 1_000_000_000);
            prop_assert_eq!(Stamp::parse_seconds(&text), Ok(Stamp::from_ns(ns)));
        }

        #[test]
        fn agrees_with_the_standard_parser(text in "[+-]?[0-9]{0,25}\\.?[0-9]{0,25}([eE][+-]?[0-9]{1,3})?") {
            match (Stamp::parse_seconds(&text), text.parse::<f64>()) {
                (Ok(stamp), Ok(s)) => {
                    let ours = stamp.ns as f64 + stamp.fraction_ns;
                    prop_assert!((ours - s * 1e9).abs() <= 1e-9 * (s * 1e9).abs() + 1e-30, "{} {}", ours, s);
                }
                (Err(StampFault::TooFar), Ok(s)) => prop_assert!(s.abs() > 9.2e9),
                (Err(StampFault::NotANumber), Err(_)) => {}
                (ours, theirs) => prop_assert!(false, "{text}: {ours:?} {theirs:?}"),
            }
        }

        #[test]
        fn never_panics(text: String) {
            let _ = Stamp::parse_seconds(&text);
        }
    }
}
