//! Colours of uncertainties, from certain to a guess.

/// Colours from 0 to 1, evenly spaced: red, green and blue in sRGB, each from 0 to 255.
pub(super) type Ramp = [[f64; 3]; 5];

/// Dark violet, blue, green, yellow: legible without colour vision too.
pub(super) const VIRIDIS: Ramp =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// Which colours a caller wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Colormap {
    /// Green, yellow, red, as in the paper's figures.
    Paper,
    /// Blue, grey, yellow: legible without colour vision too.
    Cividis,
}

impl Colormap {
    fn ramp(self) -> Ramp {
        match self {
            Self::Paper => [
                [26.0, 150.0, 65.0],
                [166.0, 217.0, 106.0],
                [255.0, 255.0, 191.0],
                [253.0, 174.0, 97.0],
                [215.0, 25.0, 28.0],
            ],
            Self::Cividis => [
                [0.0, 34.0, 78.0],
                [65.0, 77.0, 107.0],
                [125.0, 124.0, 120.0],
                [188.0, 175.0, 111.0],
                [254.0, 232.0, 56.0],
            ],
        }
    }

    /// Red, green and blue of an uncertainty in [0, 1], in sRGB, each in [0, 1].
    pub(crate) fn srgb(self, uncertainty: f64) -> [f64; 3] {
        colour(&self.ramp(), uncertainty).map(|part| part / 255.0)
    }

    /// The same in linear light.
    pub(super) fn linear(self, uncertainty: f64) -> [f64; 3] {
        self.srgb(uncertainty)
            .map(|part| if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) })
    }
}

/// The colour of an uncertainty in [0, 1], each part from 0 to 255.
pub(super) fn colour(ramp: &Ramp, uncertainty: f64) -> [f64; 3] {
    let position = uncertainty.clamp(0.0, 1.0) * (ramp.len() - 1) as f64;
    let below = (position as usize).min(ramp.len() - 2);
    let share = position - below as f64;
    std::array::from_fn(|part| (1.0 - share) * ramp[below][part] + share * ramp[below + 1][part])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_mixed_between_those_of_the_ramp_and_end_with_it() {
        assert_eq!(colour(&VIRIDIS, 0.125).map(f64::round), [64.0, 42.0, 112.0], "from violet to blue");
        assert_eq!(colour(&VIRIDIS, 7.0), VIRIDIS[4]);
    }

    #[test]
    fn certain_is_green_and_a_guess_is_red_in_the_papers_colours() {
        let [red, green, _] = Colormap::Paper.srgb(0.0);
        assert!(green > 2.0 * red);
        let [red, green, _] = Colormap::Paper.srgb(1.0);
        assert!(red > 2.0 * green);
    }

    #[test]
    fn linear_light_keeps_black_and_white_and_darkens_the_middle() {
        let [red, _, blue] = Colormap::Cividis.linear(0.0);
        assert!(red == 0.0 && (blue - 0.0762).abs() < 1e-3, "{blue}");
    }
}
