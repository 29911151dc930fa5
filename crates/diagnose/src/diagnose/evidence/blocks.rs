//! Means over blocks of pixels.

/// Means over blocks; what does not fill a block at the right and lower border is left out.
pub(crate) fn pooled(data: &[f32], w: usize, h: usize, block: usize) -> Vec<f32> {
    if block == 1 {
        return data.to_vec();
    }
    let (cw, ch) = (w / block, h / block);
    let mut out = vec![0.0f32; cw * ch * 3];
    for y in 0..ch * block {
        for x in 0..cw * block {
            let to = ((y / block) * cw + x / block) * 3;
            let from = (y * w + x) * 3;
            (0..3).for_each(|c| out[to + c] += data[from + c]);
        }
    }
    let scale = 1.0 / (block * block) as f32;
    out.iter_mut().for_each(|v| *v *= scale);
    out
}
