//! Values bent one by one: the curves that stand together, as one table.

use std::sync::{Arc, LazyLock};

use crate::camera::{Intrinsics, ScanOrder, ShutterTiming};
use crate::chain::{At, Domain, Effect, Moments, Packed, Settings, Stage, View, Work, slot_of};
use crate::effects::LIST;
use crate::plane::Plane;

/// Entries of the table of encoded values per unit: linear interpolation is within 0.01 DN above linear 0.001.
pub(super) const TABLE: usize = 8192;
/// Encoded DN of values 0 to 1, and one more entry to interpolate to.
pub(super) type Table = Arc<[f32; TABLE + 2]>;

/// Effects that are on, in the list's order.
pub(super) fn switched_on(settings: &Settings) -> impl Iterator<Item = &'static dyn Effect> {
    LIST.iter().copied().filter(|e| e.variant(settings) != 0)
}

/// Whether an effect takes encoded values.
pub(super) fn is_behind_encoding(effect: &dyn Effect) -> bool {
    matches!(effect.stage(), Stage::Pixel(Domain::EncodedRgb, _))
}

/// Nothing that the tables hold depends on where a pixel is, or when.
pub(super) const ANYWHERE: View = View {
    intrinsics: Intrinsics { width: 1, height: 1, fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5 },
    shutter: ShutterTiming {
        start_s: 0.0,
        exposure_time_s: 0.0,
        readout_time_s: 0.0,
        scan_order: ScanOrder::TopToBottom,
        line_count: 1,
    },
    frame: 0,
    seed: 0,
};

/// The curves from the first to the last that stand together, and what they make of values 0 to 1.
pub(super) fn tables(settings: &Settings) -> (Vec<&'static str>, [Table; 3]) {
    let on = switched_on(settings);
    let bends = |e: &&dyn Effect| matches!(e.moments(), Moments::Curve);
    let curves: Vec<&dyn Effect> = on.skip_while(|e| !bends(e)).take_while(bends).collect();
    let stems: Vec<&'static str> = curves.iter().map(|e| e.id()).collect();
    // The encoding alone, which every camera has.
    static PLAIN: LazyLock<Table> = LazyLock::new(|| {
        let plain = Settings::default();
        tables_of(&switched_on(&plain).collect::<Vec<_>>(), &plain)[0].clone()
    });
    let plain = settings.iter().all(|(stem, _)| !stems.contains(&stem));
    if plain {
        return (stems, [0; 3].map(|_| PLAIN.clone()));
    }
    (stems, tables_of(&curves, settings))
}

/// Greys that a curve is asked for, to see whether it bends the channels of each alike.
const GREYS: usize = 64;

/// What curves make of values, DN, by channel.
fn tables_of(curves: &[&dyn Effect], settings: &Settings) -> [Table; 3] {
    let packed = Packed::new(LIST, settings, &ANYWHERE);
    let source = Plane::new(0, 0, 4);
    let twins: Vec<_> = curves
        .iter()
        .filter_map(|e| match e.work() {
            Work::Pointwise(twin) => {
                Some((twin, e.variant(settings), packed.parameters(slot_of(LIST, e.id()))))
            }
            _ => None,
        })
        .collect();
    let bent = |value: [f32; 3]| {
        twins.iter().fold(value, |value, (twin, variant, parameters)| {
            let at = At { pixel: [0; 2], view: &ANYWHERE, source: &source, variant: *variant };
            twin(value, &at, parameters)
        })
    };
    let value = |i: usize| i as f32 / TABLE as f32;
    let mut tables = [[0.0; TABLE + 2]; 3];
    let differ = |grey: usize| {
        let [r, g, b] = bent([grey as f32 / GREYS as f32; 3]);
        r != g || g != b
    };
    if (0..=GREYS).any(differ) {
        for i in 0..TABLE + 2 {
            let bent = bent([value(i); 3]);
            tables.iter_mut().zip(bent).for_each(|(table, v)| table[i] = 255.0 * v);
        }
        return tables.map(Arc::new);
    }
    // Where channels are alike three entries are made at once.
    let [mut table, ..] = tables;
    for i in (0..TABLE + 2).step_by(3) {
        let three = bent([value(i), value(i + 1), value(i + 2)]);
        table[i..].iter_mut().zip(three).for_each(|(to, v)| *to = 255.0 * v);
    }
    let table = Arc::new(table);
    [0; 3].map(|_| table.clone())
}
