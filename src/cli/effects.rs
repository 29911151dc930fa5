//! `shutterbug effects`: every effect with its parameters, from the one list that drives everything else.

use crate::chain::ParamKind;
use crate::effects;

/// Prints the effects in light-path order.
pub fn run() {
    for effect in effects::LIST {
        println!("[{}]", effect.id());
        for spec in effect.specs() {
            let unit = if spec.unit.is_empty() { String::new() } else { format!(" {}", spec.unit) };
            println!("  {:<20} {}{unit}: {}", spec.name, values(&spec.kind), spec.about);
        }
    }
}

fn values(kind: &ParamKind) -> String {
    match kind {
        ParamKind::Number { min, max, neutral } => format!("{min} to {max}, neutral {neutral},"),
        ParamKind::Integer { min, max, neutral } => format!("whole, {min} to {max}, neutral {neutral},"),
        ParamKind::Choice { options, neutral } => format!("{}, neutral {neutral},", options.join(" | ")),
        ParamKind::Vector3 { max } => format!("[x, y, z], each {} to {max}, neutral 0,", -max),
    }
}
