//! When those who were refused are told to come back: one after the other, as fast as there are places.

use std::time::Duration;

use tokio::time::Instant;

/// The part of a hint by which it is lengthened at most.
const JITTER: f64 = 0.25;

/// The fractional part of the golden ratio: multiples of it are spread more evenly over the interval from 0 to 1 than
/// random numbers are.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// The places that were promised last.
#[derive(Debug, Default)]
pub(crate) struct Invitations {
    next: Option<Instant>,
    made: u32,
}

impl Invitations {
    /// The moment of the next place from `earliest` on, where places come one `apart` from the other.
    pub(crate) fn next(&mut self, earliest: Instant, apart: Duration) -> Instant {
        let place = self.next.map_or(earliest, |next| next.max(earliest));
        self.next = Some(place + apart);
        place
    }

    /// How long to wait until `place`, and somewhat longer, so that those who are told the same come apart.
    pub(crate) fn hint(&mut self, now: Instant, place: Instant) -> Duration {
        self.made = self.made.wrapping_add(1);
        let wait = place.saturating_duration_since(now).max(Duration::from_millis(1));
        wait.mul_f64(1.0 + JITTER * (f64::from(self.made) * GOLDEN).fract())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_refused_come_back_one_after_the_other() {
        let (now, ms) = (Instant::now(), Duration::from_millis);
        let mut invitations = Invitations::default();
        let places: Vec<Instant> = (0..3).map(|_| invitations.next(now + ms(40), ms(10))).collect();
        assert_eq!(places, [40, 50, 60].map(|at| now + ms(at)));
        let later = now + ms(500);
        assert_eq!(invitations.next(later, ms(10)), later, "places that nobody wanted are gone");
    }

    #[test]
    fn hints_for_one_place_are_never_short_and_lie_apart() {
        let now = Instant::now();
        let mut invitations = Invitations::default();
        let wait = Duration::from_millis(400);
        let mut hints: Vec<Duration> = (0..20).map(|_| invitations.hint(now, now + wait)).collect();
        hints.sort();
        assert!(hints[0] >= wait && hints[19] <= wait.mul_f64(1.0 + JITTER), "{hints:?}");
        assert!(hints.windows(2).all(|pair| pair[1] - pair[0] > Duration::from_millis(1)), "{hints:?}");
    }
}
