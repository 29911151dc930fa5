//! Chunks of recordings, unpacked. What comes out is held against what was stated while it comes out, so that a small
//! chunk cannot fill the memory.

use std::io::Read;

use super::wire::Fault;

/// Largest record, and largest chunk when unpacked, bytes. A picture of the largest size that is read is below it.
pub(super) const MAX_BYTES: u64 = 512 << 20;
/// Longest window of zstd, bytes: what its own tool allows by default.
const ZSTD_WINDOW: u64 = 128 << 20;

/// Unpacks a chunk in place of what `into` holds. `stated`: its length when unpacked; without one, up to
/// [`MAX_BYTES`].
pub(super) fn unpack(how: &str, packed: &[u8], stated: Option<u64>, into: &mut Vec<u8>) -> Result<(), Fault> {
    let limit = stated.unwrap_or(MAX_BYTES);
    if limit > MAX_BYTES {
        let found = format!("a chunk of {limit} bytes when unpacked");
        return Err(Fault::new(found, format!("{MAX_BYTES} bytes at most")));
    }
    into.clear();
    let done = match how {
        "zstd" => unpack_zstd(packed, limit, into),
        "lz4" => drain(lz4_flex::frame::FrameDecoder::new(packed), limit, into),
        "bz2" => drain(bzip2::read::BzDecoder::new(packed), limit, into),
        other => {
            let found = format!("a chunk packed with `{}`", super::shortened(other));
            return Err(Fault::new(found, "none, zstd, lz4 or bz2"));
        }
    };
    done.map_err(|e| Fault::new(format!("a {how} chunk that does not unpack ({e})"), "a whole chunk"))?;
    let bytes = into.len() as u64;
    if stated.is_some_and(|s| s != bytes) || bytes > limit {
        let more = if bytes > limit { "more than " } else { "" };
        let found = format!("a {how} chunk that unpacks to {more}{} bytes", bytes.min(limit));
        return Err(Fault::new(found, format!("{limit} bytes")));
    }
    Ok(())
}

/// One byte beyond the limit tells too long from just fitting.
fn drain(from: impl Read, limit: u64, into: &mut Vec<u8>) -> std::io::Result<()> {
    let left = (limit + 1).saturating_sub(into.len() as u64);
    from.take(left).read_to_end(into).map(|_| ())
}

/// Frame after frame, as zstd's own tool does.
fn unpack_zstd(packed: &[u8], limit: u64, into: &mut Vec<u8>) -> std::io::Result<()> {
    let mut left = packed;
    while !left.is_empty() && into.len() as u64 <= limit {
        let frame = ruzstd::decoding::StreamingDecoder::new_with_max_window_size(&mut left, ZSTD_WINDOW);
        drain(frame.map_err(std::io::Error::other)?, limit, into)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lz4(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        std::io::Write::write_all(&mut encoder, bytes).expect("written");
        encoder.finish().expect("finished")
    }

    fn bz2(bytes: &[u8]) -> Vec<u8> {
        let mut packed = Vec::new();
        let mut encoder = bzip2::read::BzEncoder::new(bytes, bzip2::Compression::best());
        encoder.read_to_end(&mut packed).expect("packed");
        packed
    }

    fn zstd(bytes: &[u8]) -> Vec<u8> {
        ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
    }

    #[test]
    fn what_was_packed_comes_out_and_no_more_than_was_stated() {
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i / 700) as u8).collect();
        for (how, packed) in [("lz4", lz4(&bytes)), ("bz2", bz2(&bytes)), ("zstd", zstd(&bytes))] {
            let mut out = Vec::new();
            unpack(how, &packed, Some(200_000), &mut out).unwrap_or_else(|e| panic!("{how}: {e:?}"));
            assert_eq!(out, bytes, "{how}");
            // A bomb: far more comes out than is stated. The memory stays near what was stated.
            let mut out = Vec::new();
            let fault = unpack(how, &packed, Some(100), &mut out).expect_err("more than stated");
            assert!(fault.found.contains("more than 100 bytes") && out.len() <= 101, "{fault:?}");
            assert!(unpack(how, &packed, Some(200_001), &mut out).is_err(), "{how}: less than stated");
            assert!(unpack(how, &packed[..packed.len() / 2], Some(200_000), &mut out).is_err(), "{how}: cut");
        }
        let absurd = unpack("zstd", &[], Some(u64::MAX), &mut Vec::new()).expect_err("absurd");
        assert!(absurd.expected.contains("536870912"), "{absurd:?}");
        assert!(
            unpack("snappy", &[], Some(0), &mut Vec::new()).expect_err("unknown").found.contains("`snappy`")
        );
    }

    #[test]
    fn spoiled_chunks_are_refused_without_a_panic() {
        let bytes: Vec<u8> = (0..5_000u32).map(|i| (i * i / 97) as u8).collect();
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as usize
        };
        for (how, packed) in [("lz4", lz4(&bytes)), ("bz2", bz2(&bytes)), ("zstd", zstd(&bytes))] {
            for _ in 0..2_000 {
                let mut spoiled = packed.clone();
                for _ in 0..1 + next() % 4 {
                    let at = next() % spoiled.len();
                    spoiled[at] = next() as u8;
                }
                // Whatever comes out: it is no more than was stated.
                let mut out = Vec::new();
                let _ = unpack(how, &spoiled, Some(5_000), &mut out);
                assert!(out.len() <= 5_001);
            }
        }
    }
}
