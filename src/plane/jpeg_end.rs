//! Whether a JPEG goes on to its end. Decoders fill what is missing with grey and say nothing, and grey is measured.

/// Whether the marker that ends a picture stands where its parts lead to. Thumbnails inside have ends of their own, and
/// phones write more behind the end, so neither a search nor a look at the last bytes would do.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    let mut at = 2;
    while let Some(&[first, marker]) = bytes.get(at..at + 2) {
        if first != 0xff {
            return false;
        }
        at = match marker {
            0xd9 => return true,
            // A fill byte, and markers without a length.
            0xff => at + 1,
            0x01 | 0xd0..=0xd7 => at + 2,
            _ => {
                let Some(&[high, low]) = bytes.get(at + 2..at + 4) else { return false };
                let behind = at + 2 + usize::from(u16::from_be_bytes([high, low])).max(2);
                if marker == 0xda { behind_scan(bytes, behind) } else { behind }
            }
        };
    }
    false
}

/// Where the coded data that starts at `from` ends: at a marker that is neither a stuffed byte nor a restart.
fn behind_scan(bytes: &[u8], from: usize) -> usize {
    let rest = bytes.get(from..).unwrap_or_default();
    let marker = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0 | 0xd0..=0xd7 | 0xff);
    rest.windows(2).position(marker).map_or(bytes.len(), |p| from + p)
}

#[cfg(test)]
mod tests {
    use super::is_whole;

    #[test]
    fn the_end_is_that_of_the_picture_and_not_of_a_thumbnail() {
        // Start, an APP1 of 6 bytes that holds an end, a scan with a stuffed byte and a restart, the end.
        let whole = [
            0xff, 0xd8, 0xff, 0xe1, 0, 6, 0xff, 0xd9, 1, 2, 0xff, 0xda, 0, 2, 7, 0xff, 0, 8, 0xff, 0xd3, 9,
            0xff, 0xd9,
        ];
        assert!(is_whole(&whole));
        (0..whole.len()).for_each(|n| assert!(!is_whole(&whole[..n]), "{n} bytes"));
    }
}
