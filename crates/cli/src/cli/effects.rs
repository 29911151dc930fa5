//! `shutterbug effects`: every effect with its parameters, from the one list that drives everything else.

use super::terminal::print;
use shutterbug::chain::ParamKind;
use shutterbug::effects;
use shutterbug::error::Result;

/// Prints the effects in light-path order.
///
/// # Errors
/// Standard output that cannot be written.
pub fn run() -> Result<()> {
    let mut text = String::new();
    for effect in effects::LIST {
        text += &format!("[{}]\n", effect.id());
        for spec in effect.specs() {
            let unit = if spec.unit.is_empty() { String::new() } else { format!(", {}", spec.unit) };
            text += &format!("  {:<20} {}{unit}: {}\n", spec.name, values(&spec.kind), spec.about);
        }
    }
    print(text)
}

fn values(kind: &ParamKind) -> String {
    match kind {
        ParamKind::Number { min, max, neutral } => format!("{min} to {max}, neutral {neutral}"),
        ParamKind::Integer { min, max, neutral } => format!("whole, {min} to {max}, neutral {neutral}"),
        ParamKind::Choice { options, neutral } => format!("{}, neutral {neutral}", options.join(" | ")),
        ParamKind::Vector3 { max } => format!("[x, y, z], each {} to {max}, neutral 0", -max),
    }
}
