//! Which way round a checkerboard lies. Its grid looks the same turned by half (a square one: by a quarter), its
//! colours may not.

use glam::DVec2;

use super::refine::sample;
use super::target::{Seen, View};
use shutterbug::plane::Plane;

/// Whether the squares whose column and row add up to an even number are the dark ones, the first square between inner
/// corners being the first; `None` where no square is seen whole.
pub(super) fn even_is_dark(grey: &Plane<u8>, view: &View, size: [usize; 2]) -> Option<bool> {
    let mut sums = [(0.0, 0usize); 2];
    for (i, j) in (0..size[0] - 1).flat_map(|i| (0..size[1] - 1).map(move |j| (i, j))) {
        let corners = [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]].map(|p| view.px(p));
        let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
        let middle: DVec2 = (a + b + c + d) * 0.25;
        let sum = &mut sums[(i + j) % 2];
        (sum.0, sum.1) = (sum.0 + sample(grey, middle), sum.1 + 1);
    }
    let [even, odd] = sums.map(|(sum, n)| (n > 0).then(|| sum / n as f64));
    Some(even? < odd?)
}

/// The view with its points counted from another corner, `quarters` further round.
pub(super) fn turned(view: &View, size: [usize; 2], quarters: usize) -> View {
    let [columns, rows] = size;
    let turn = |[c, r]: [usize; 2]| match quarters % 4 {
        0 => [c, r],
        1 => [r, columns - 1 - c],
        2 => [columns - 1 - c, rows - 1 - r],
        _ => [rows - 1 - r, c],
    };
    let seen = view.seen.iter().map(|s| Seen { point: turn(s.point), px: s.px }).collect();
    View { seen, ..view.clone() }
}

/// Turns after which the grid looks the same.
fn ways(size: [usize; 2]) -> &'static [usize] {
    if size[0] == size[1] { &[0, 1, 2, 3] } else { &[0, 2] }
}

/// Whether a turn takes dark squares to bright ones.
fn swaps(size: [usize; 2], quarters: usize) -> bool {
    let moved = match quarters {
        0 => 0,
        2 => size[0] + size[1],
        _ => size[0],
    };
    moved % 2 == 1
}

/// Turns the views so that the same squares are dark in all of them; in frames that follow each other (`near`), of what
/// is left open the turn that keeps points nearest to where they were. `dark` says of each view whether its even
/// squares are. Returns whether even squares are dark now; views that cannot be turned so are emptied.
pub(super) fn align(views: &mut [View], dark: &[Option<bool>], size: [usize; 2], near: bool) -> bool {
    let can_swap = ways(size).iter().any(|q| swaps(size, *q));
    let votes = |wanted: bool| dark.iter().filter(|d| **d == Some(wanted)).count();
    let wanted = can_swap || votes(true) >= votes(false);
    let mut before: Option<View> = None;
    for (view, dark) in views.iter_mut().zip(dark) {
        let fits = |q: &&usize| dark.is_some_and(|d| d != swaps(size, **q)) == wanted && dark.is_some();
        let turns: Vec<View> = ways(size).iter().filter(fits).map(|q| turned(view, size, *q)).collect();
        let way = |v: &View| before.as_ref().filter(|_| near).map_or(0.0, |b| distance(b, v));
        match turns.into_iter().min_by(|a, b| way(a).total_cmp(&way(b))) {
            Some(turned) => {
                *view = turned;
                before = Some(view.clone());
            }
            None => view.seen.clear(),
        }
    }
    wanted
}

/// Mean distance of the points that both show, px.
fn distance(a: &View, b: &View) -> f64 {
    let both: Vec<f64> = b.seen.iter().filter_map(|s| a.px(s.point).map(|px| (px - s.px).length())).collect();
    both.iter().sum::<f64>() / both.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(size: [usize; 2]) -> View {
        let point = |i: usize| [i % size[0], i / size[0]];
        let seen = (0..size[0] * size[1])
            .map(|i| Seen {
                point: point(i),
                px: DVec2::new(10.0 * point(i)[0] as f64 + 10.0, 10.0 * point(i)[1] as f64 + 10.0),
            })
            .collect();
        View { picture: 0, seen }
    }

    fn board(even_dark: bool) -> Plane<u8> {
        Plane::from_fn(120, 90, |x, y| [if ((x / 10 + y / 10) % 2 == 0) == even_dark { 20u8 } else { 220 }])
    }

    #[test]
    fn colours_decide_where_the_grid_leaves_it_open() {
        let size = [9, 6];
        let upright = view(size);
        assert_eq!(even_is_dark(&board(true), &upright, size), Some(true));
        assert_eq!(even_is_dark(&board(false), &upright, size), Some(false));
        let mut views = [upright.clone(), turned(&upright, size, 2)];
        let dark = [0, 1].map(|i| even_is_dark(&board(true), &views[i], size));
        assert_eq!(dark, [Some(true), Some(false)], "half a turn swaps the colours of 10x7 squares");
        assert!(align(&mut views, &dark, size, false));
        assert_eq!(views[0].px([0, 0]), views[1].px([0, 0]));
        // Control: of 8x6 corners half a turn changes nothing that can be seen; only time can tell.
        let size = [8, 6];
        let upright = view(size);
        let mut views = [upright.clone(), turned(&upright, size, 2)];
        let dark = [0, 1].map(|i| even_is_dark(&board(true), &views[i], size));
        assert_eq!(dark, [Some(true); 2]);
        align(&mut views, &dark, size, false);
        assert_ne!(views[0].px([0, 0]), views[1].px([0, 0]));
        align(&mut views, &dark, size, true);
        assert_eq!(views[0].px([0, 0]), views[1].px([0, 0]));
    }
}
