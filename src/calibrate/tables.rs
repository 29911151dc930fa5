//! The result as tables of `camera.toml`.

use super::model::IspCamera;
use super::noise::Calibration;
use crate::effects;

/// One table: an effect's stem, and its parameters as TOML values.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Stem of the effect.
    pub effect: &'static str,
    /// Names and values.
    pub values: Vec<(&'static str, String)>,
}

fn number(value: f64) -> String {
    format!("{value:.6e}")
}

/// Tables of the fitted camera, in light-path order.
pub fn camera_tables(camera: &IspCamera) -> Vec<Table> {
    let mut tables =
        vec![Table { effect: "shot_noise", values: vec![("full_well_e", number(camera.full_well_e))] }];
    let mut add = |effect, values| tables.push(Table { effect, values });
    if camera.row_sigma > 0.0 {
        add("row_noise", vec![("sigma", number(camera.row_sigma))]);
    }
    add("read_noise", vec![("sigma", number(camera.read_sigma))]);
    if camera.bayer {
        add("bayer_mosaic", vec![("pattern", "\"RGGB\"".into()), ("demosaic", "\"bilinear\"".into())]);
        let [r, _, b] = camera.white_balance;
        add("white_balance", vec![("r", number(r)), ("b", number(b))]);
        let names = [["rr", "rg", "rb"], ["gr", "gg", "gb"], ["br", "bg", "bb"]];
        let entries = names.iter().zip(&camera.color_matrix).flat_map(|(n, m)| n.iter().zip(m));
        add("color_matrix", entries.map(|(n, m)| (*n, number(*m))).collect());
        add(
            "noise_reduction",
            vec![
                ("luma_sigma_px", number(camera.luma_sigma_px)),
                ("chroma_sigma_px", number(camera.chroma_sigma_px)),
            ],
        );
    }
    match camera.chroma_step {
        [2, 2] => add("chroma_subsampling", vec![("scheme", "\"4:2:0\"".into())]),
        [2, 1] => add("chroma_subsampling", vec![("scheme", "\"4:2:2\"".into())]),
        _ => {}
    }
    if let Some(quality) = camera.jpeg_quality {
        add("jpeg", vec![("quality", quality.to_string())]);
    }
    tables
}

/// The paper's own noise, as an alternative to [`camera_tables`]: variances per channel of the delivered picture.
pub fn paper_tables(c: &Calibration) -> Vec<Table> {
    let mut values = Vec::new();
    let mut add = |names: [&'static str; 3], v: [f64; 3]| {
        values.extend(names.into_iter().zip(v.map(|v| number(v.clamp(0.0, 1.0)))));
    };
    if let Some(fixed) = c.static_variance {
        add(["static_variance_r", "static_variance_g", "static_variance_b"], fixed);
    }
    add(["color_variance_r", "color_variance_g", "color_variance_b"], c.color_variance);
    if let Some(edge) = &c.edge_variance {
        // An edge part that is not there beyond chance is none.
        let sure = edge.each_ref().map(|e| if e.ci95[0] > 0.0 { e.value } else { 0.0 });
        add(["edge_variance_r", "edge_variance_g", "edge_variance_b"], sure);
    }
    vec![Table { effect: "paper_noise", values }]
}

/// TOML text of the tables. What this build has no effect or parameter for stands there as a comment, so that the file
/// can be read; the second value lists those.
pub fn to_toml(tables: &[Table]) -> (String, Vec<String>) {
    let (mut text, mut missing) = (String::new(), Vec::new());
    for table in tables {
        let effect = effects::by_id(table.effect);
        let mark = if effect.is_some() { "" } else { "# " };
        if effect.is_none() {
            missing.push(table.effect.to_owned());
        }
        text += &format!("\n{mark}[{}]\n", table.effect);
        for (name, value) in &table.values {
            let known = effect.is_some_and(|e| e.specs().iter().any(|s| s.name == *name));
            if effect.is_some() && !known {
                missing.push(format!("{}.{name}", table.effect));
            }
            text += &format!("{}{name} = {value}\n", if known { "" } else { "# " });
        }
    }
    (text, missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_build_lacks_is_a_comment() {
        let table =
            |effect| Table { effect, values: vec![("color_variance_r", "1e-4".into()), ("odd", "1".into())] };
        let (text, missing) = to_toml(&[table("paper_noise"), table("no_such_effect")]);
        assert!(text.contains("\n[paper_noise]\ncolor_variance_r = 1e-4\n# odd = 1\n"), "{text}");
        assert!(text.contains("\n# [no_such_effect]\n# color_variance_r = 1e-4\n"), "{text}");
        assert_eq!(missing, ["paper_noise.odd", "no_such_effect"]);
        assert!(text.parse::<toml::Table>().is_ok());
    }
}
