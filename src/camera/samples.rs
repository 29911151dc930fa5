//! Where inside a pixel the picture is sampled. The CPU oracle and the Vulkan rasterizer share these places, so that
//! they may differ by rounding only, not by pattern.

/// Vulkan's standard sample locations for four samples (Vulkan specification, "Multisampling", table of standard
/// sample locations), as fractions of a pixel from its top left corner.
const STANDARD_4: [[f32; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];

/// Sample places inside a pixel, `[x, y]` in px from its top left corner, each in 0..1. All weigh the same: the mean
/// over them approximates the pixel's box.
///
/// * 1: the centre;
/// * 4: Vulkan's standard locations (a rotated grid: four different x and four different y);
/// * 16: 2x2 sub-pixels, row by row, each with the standard four: 2x2 supersampling of four-sample rasterization.
///
/// # Panics
/// For any other number.
pub fn sample_positions(samples: u32) -> Vec<[f32; 2]> {
    match samples {
        1 => vec![[0.5, 0.5]],
        4 => STANDARD_4.to_vec(),
        16 => [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]]
            .into_iter()
            .flat_map(|[x, y]| STANDARD_4.map(|[sx, sy]| [x + 0.5 * sx, y + 0.5 * sy]))
            .collect(),
        n => panic!("a pixel has 1, 4 or 16 samples, not {n}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_centred_and_stratified() {
        for n in [1_u32, 4, 16] {
            let places = sample_positions(n);
            assert_eq!(places.len(), n as usize);
            for axis in 0..2 {
                let mut along: Vec<f32> = places.iter().map(|p| p[axis]).collect();
                along.sort_by(f32::total_cmp);
                let mean = along.iter().sum::<f32>() / n as f32;
                assert_eq!(mean, 0.5, "{n} samples are centred");
                // Each axis sees equal steps of 1/4 (1/8 with 16 samples), so an axis-parallel edge that sweeps over
                // the pixel changes it evenly.
                along.dedup();
                let levels = if n == 16 { 8 } else { n as usize };
                assert_eq!(along.len(), levels);
                for pair in along.windows(2) {
                    assert_eq!(pair[1] - pair[0], 1.0 / levels as f32);
                }
            }
        }
    }
}
