/// So many of a thing in words: "1 frame", "2 frames". `one` and `many` are the thing, with its verb where that changes
/// too ("frame is", "frames are").
pub fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn one_of_a_thing_is_no_plural() {
        let pairs = [0, 1, 2].map(|n| counted(n, "pair of frames", "pairs of frames"));
        assert_eq!(pairs, ["0 pairs of frames", "1 pair of frames", "2 pairs of frames"]);
    }
}
