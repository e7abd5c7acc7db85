//! Which costly extras each fit of METHOD_PALPATE does, besides going on from the one before.
//!
//! None of them changes with every touch, so each is done in every fourth fit, one at a time: every
//! step stays short.

/// In the first fits new starts are always tried: little is known, and the template changes most.
const FIRST_FITS: usize = 3;
/// Each extra is done once in this many fits.
const PERIOD: usize = 4;

/// The extras of one fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extras {
    /// The template is also fitted from new starts.
    pub starts: bool,
    /// The noise of the sensors is estimated.
    pub noise: bool,
    /// Templates with one more part are tried.
    pub splits: bool,
    /// The symmetry is selected anew.
    pub symmetry: bool,
    /// Other readings of the evidence are tried.
    pub readings: bool,
}

impl Extras {
    /// Those of a fit by its number, the first being 1.
    pub fn of_fit(number: usize) -> Self {
        let place = number % PERIOD;
        Self {
            starts: number <= FIRST_FITS || place == 0,
            noise: place == 1,
            splits: place == 2,
            symmetry: place == 3,
            readings: place == 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_extra_comes_once_in_four_fits_and_new_starts_in_the_first_three_too() {
        let fits: Vec<Extras> = (1..=12).map(Extras::of_fit).collect();
        let count = |of: fn(&Extras) -> bool| fits.iter().filter(|extras| of(extras)).count();
        assert_eq!(count(|e| e.noise), 3);
        assert_eq!(count(|e| e.splits), 3);
        assert_eq!(count(|e| e.symmetry), 3);
        assert_eq!(count(|e| e.starts), 6);
        assert!(fits[..3].iter().all(|extras| extras.starts));
    }
}
