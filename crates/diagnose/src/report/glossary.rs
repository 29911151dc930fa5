//! The page's words that a newcomer does not know: what they mean is shown over them, and stands in a list at the end
//! for paper and for screen readers. The texts are those of `docs/concepts/glossary.md`; a test compares them.

use minijinja::Value;

/// A word and what it means.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    /// How templates ask for it.
    pub(super) key: &'static str,
    /// Its name in the glossary.
    pub(super) name: &'static str,
    /// What it means.
    pub(super) meaning: &'static str,
}

const fn term(key: &'static str, name: &'static str, meaning: &'static str) -> Term {
    Term { key, name, meaning }
}

/// All terms of the page, in the order of the alphabet.
pub(super) const TERMS: &[Term] = &[
    term(
        "alias",
        "Alias",
        "Two effects that do the same on the frames at hand. Reports list them as alternatives.",
    ),
    term(
        "interval",
        "Confidence interval",
        "Here always 95 %: in 95 of 100 such diagnoses the interval should hold the true value.",
    ),
    term(
        "crps",
        "CRPS",
        "Continuous ranked probability score: a proper score of a predicted distribution against an observed value. \
         It is in the unit of the value, and equals the absolute error where the prediction has no spread.",
    ),
    term("dn", "DN", "Digital number: one grey level of an 8-bit picture, 0 to 255."),
    term(
        "floor",
        "Floor",
        "The gap that a perfect model would still have, because noise cannot be predicted.",
    ),
    term("gap", "Gap", "How far real and simulated frames are apart, as CRPS in DN (the gap)."),
    term(
        "held_out",
        "Held-out frames",
        "Frames that no fit and no choice has seen. All figures of a report are of these.",
    ),
    term(
        "margin",
        "Margin of a diagnosis",
        "What two correct simulations of the same camera may differ by. A gap within it counts as no gap.",
    ),
    term(
        "shapley",
        "Shapley value",
        "A fair share of a joint result: the mean gain of a member over all orders in which members could be added.",
    ),
];

/// All terms, for templates.
pub(super) fn all() -> Value {
    let pairs = |t: &Term| Value::from_pairs([("key", t.key), ("name", t.name), ("meaning", t.meaning)]);
    TERMS.iter().map(pairs).collect()
}

/// `word|term("key")`: the word with its meaning over it.
pub(super) fn mark(word: &str, key: &str) -> Value {
    let term = TERMS.iter().find(|t| t.key == key);
    let Term { meaning, .. } = term.unwrap_or_else(|| panic!("no term `{key}` in the glossary"));
    let html = format!(
        "<span class=\"term\" tabindex=\"0\" aria-describedby=\"term-{key}\" data-tip=\"{meaning}\">{word}</span>"
    );
    Value::from_safe_string(html)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Text of the book's glossary without marks and links, on one line.
    fn book() -> String {
        let text = include_str!("../../../../docs/concepts/glossary.md");
        let links = text.replace("[the gap](gap.md)", "the gap");
        let words: Vec<_> = links.split_whitespace().collect();
        words.join(" ").replace(['*', '`'], "")
    }

    #[test]
    fn the_page_and_the_book_say_the_same() {
        let book = book();
        for term in TERMS {
            let want = format!("{}. {}", term.name, term.meaning);
            assert!(book.contains(&want), "{want}");
            // Control: another word is missed.
            assert!(!book.contains(&want.replacen(" the ", " thy ", 1)) || !want.contains(" the "));
        }
        assert!(TERMS.is_sorted_by_key(|t| t.name.to_lowercase()));
        // They stand in attributes as they are.
        assert!(TERMS.iter().all(|t| !t.meaning.contains(['"', '<', '&'])));
    }
}
