//! Differences between pictures.

use super::Plane;

/// Mean absolute difference, in the unit of the values.
///
/// # Panics
/// If the shapes differ.
pub fn mean_absolute_difference(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    assert_same_shape(a, b);
    let sum: u64 = a.data.iter().zip(&b.data).map(|(&a, &b)| u64::from(a.abs_diff(b))).sum();
    sum as f64 / a.data.len() as f64
}

/// Root of the mean squared difference, in the unit of the values.
///
/// # Panics
/// If the shapes differ.
pub fn rmse(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    assert_same_shape(a, b);
    let sum: u64 = a.data.iter().zip(&b.data).map(|(&a, &b)| u64::from(a.abs_diff(b)).pow(2)).sum();
    (sum as f64 / a.data.len() as f64).sqrt()
}

/// Peak signal-to-noise ratio of 8-bit pictures, dB; infinite for equal ones.
///
/// # Panics
/// If the shapes differ.
pub fn psnr_db(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    20.0 * (255.0 / rmse(a, b)).log10()
}

fn assert_same_shape<T>(a: &Plane<T>, b: &Plane<T>) {
    assert_eq!(
        (a.width, a.height, a.channels),
        (b.width, b.height, b.channels),
        "pictures of different shapes cannot be compared"
    );
}
