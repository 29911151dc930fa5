//! The template engine, and how figures are written for people.

use minijinja::{AutoEscape, Environment, Value};

use super::glossary::{all, mark};

/// The style sheet and the shared parts of all pages of this program.
const STYLE: &str = include_str!("style.css");

/// A template engine that escapes everything for HTML, with the filters of this file and the parts shared by all pages.
///
/// # Panics
/// Never: the shared parts are constants that the tests render.
pub fn environment() -> Environment<'static> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_filter("num", |v: Value| value_text(&v));
    environment.add_filter("span", |v: Value| span_text(&v));
    environment.add_filter("dn", |v: Value| fixed(&v, 2));
    environment.add_filter("px", |v: Value| fixed(&v, 1));
    environment.add_filter("pct", |v: Value| f64::try_from(v).map_or_else(|_| "–".to_owned(), percent));
    environment.add_filter("plain", |v: &str| plain_name(v));
    environment.add_filter("term", |word: &str, key: &str| mark(word, key));
    environment.add_global("terms", all());
    environment.add_global("style", Value::from_safe_string(STYLE.to_owned()));
    environment.add_template("charts.html", include_str!("charts.html")).expect("a constant template");
    environment
}

/// Renders a constant template.
///
/// # Panics
/// If the template and its data do not fit together: a mistake in this crate that the tests find.
pub(super) fn render(name: &'static str, template: &'static str, data: Value) -> String {
    let mut environment = environment();
    environment.add_template(name, template).unwrap_or_else(|e| panic!("{name}: {e:#}"));
    let template = environment.get_template(name).expect("just added");
    template.render(data).unwrap_or_else(|e| panic!("{name}: {e:#}"))
}

/// A number with at most five significant digits: "0.020134", "1.5e-7", "785".
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-5..9).contains(&magnitude) {
        return format!("{value:.4e}");
    }
    let decimals = (4 - magnitude).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if !text.contains('.') {
        return text;
    }
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// A share as "83.1 %".
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.1} %", 100.0 * share) } else { "–".to_owned() }
}

/// A name of the contract for prose: "rolling shutter".
pub fn plain_name(name: &str) -> String {
    name.replace('_', " ")
}

fn fixed(value: &Value, decimals: usize) -> String {
    match f64::try_from(value.clone()) {
        Ok(v) if v.is_finite() => format!("{v:.decimals$}"),
        _ => "–".to_owned(),
    }
}

/// Numbers by [`number`], lists of them in brackets, names as they are, nothing as a dash.
fn value_text(value: &Value) -> String {
    if value.is_none() || value.is_undefined() {
        return "–".to_owned();
    }
    if let Ok(v) = f64::try_from(value.clone()) {
        return number(v);
    }
    match value.as_str() {
        Some(text) => text.to_owned(),
        None => match value.try_iter() {
            Ok(items) => {
                let items: Vec<_> = items.map(|v| value_text(&v)).collect();
                format!("[{}]", items.join(", "))
            }
            Err(_) => value.to_string(),
        },
    }
}

/// `[a, b]` as "a to b", a list of such pairs one after the other.
fn span_text(value: &Value) -> String {
    let items: Vec<Value> = value.try_iter().map(Iterator::collect).unwrap_or_default();
    match items.as_slice() {
        [] => value_text(value),
        [from, to] if from.try_iter().is_err() => format!("{} to {}", value_text(from), value_text(to)),
        several => several.iter().map(span_text).collect::<Vec<_>>().join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_keep_five_digits_and_lose_noise() {
        for (value, text) in [
            (0.0, "0"),
            (0.020_134_4, "0.020134"),
            (785.0, "785"),
            (123_456.0, "123456"),
            (-1.5, "-1.5"),
            (1.5e-7, "1.5000e-7"),
            (0.1 + 0.2, "0.3"),
            (100.0, "100"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(percent(0.8312), "83.1 %");
    }

    #[test]
    fn values_of_any_shape_are_written() {
        let text = |json: serde_json::Value| value_text(&Value::from(minijinja::value::Serde(json)));
        assert_eq!(text(serde_json::json!([0.1, [1, 2.50]])), "[0.1, [1, 2.5]]");
        assert_eq!(text(serde_json::json!("top_to_bottom")), "top_to_bottom");
        assert_eq!(text(serde_json::json!(null)), "–");
        let span = |json: serde_json::Value| span_text(&Value::from(minijinja::value::Serde(json)));
        assert_eq!(span(serde_json::json!([0.1, 0.2])), "0.1 to 0.2");
        assert_eq!(span(serde_json::json!([[0, 1], [2, 3]])), "0 to 1; 2 to 3");
    }
}
