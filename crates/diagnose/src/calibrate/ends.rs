//! Single pixels that are white or black, unlike their neighbours.

/// Which white and black pixels have no such neighbour: what is white or black around them too is what the picture
/// shows.
pub(super) fn alone(ends: &[[bool; 2]], width: usize) -> Vec<[bool; 2]> {
    let beside = |i: usize| {
        let x = i % width;
        let across = [(x > 0).then(|| i - 1), (x + 1 < width).then_some(i + 1)];
        across
            .into_iter()
            .chain([i.checked_sub(width), Some(i + width)])
            .flatten()
            .filter_map(|j| ends.get(j))
    };
    let of = |(i, own): (usize, &[bool; 2])| [0, 1].map(|k| own[k] && !beside(i).any(|other| other[k]));
    ends.iter().enumerate().map(of).collect()
}

/// Whether a pixel is white or black.
pub(super) fn is_end(end: &[bool; 2]) -> bool {
    end[0] || end[1]
}

/// Mean of a picture, which takes the place of stuck pixels: they say nothing of light and gains.
pub(super) fn level_of(light: &mut [f32], ends: &[[bool; 2]]) -> f64 {
    let inside = light.iter().zip(ends).filter(|(_, end)| !is_end(end));
    let (sum, n) = inside.fold((0.0, 0usize), |(sum, n), (v, _)| (sum + f64::from(*v), n + 1));
    let level = sum / n.max(1) as f64;
    light.iter_mut().zip(ends).filter(|(_, end)| is_end(end)).for_each(|(v, _)| *v = level as f32);
    level
}
