//! Arithmetic for many numbers at a time.
//!
//! Loops of plain arithmetic are compiled into the widest instructions of the processor, which is asked
//! when the program runs ([`widest`]). What the standard library calls for one number at a time, `exp` and
//! `ln`, is written out here without a branch, so that such loops may hold it. Lanes are summed in an order
//! that is written down, so that a result does not depend on how wide the instructions are.

/// Does some work with the widest instructions there are. Give it a closure that is marked
/// `#[inline(always)]`, made of functions that are: what is called instead stays narrow.
#[inline(always)]
pub(crate) fn widest<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// The larger of two numbers that are none of them NaN: one instruction, where the standard library's takes three.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// `e^x` in single precision, to about one unit in the last place; what would overflow, or vanish, stays at
/// the bound.
#[inline(always)]
pub(crate) fn exp_f32(x: f32) -> f32 {
    /// Adding it leaves the nearest whole number in the last bits.
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-87.0, 88.0);
    // x = n ln 2 + r.
    let shifted = x.mul_add(std::f32::consts::LOG2_E, ROUND);
    let n = shifted - ROUND;
    let r = n.mul_add(-0.693_359_4, x);
    let r = n.mul_add(2.121_944_4e-4, r);
    // Taylor's series: what is left of it is less than a unit in the last place.
    let mut power = 1.0 / 5040.0;
    for factorial in [720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0] {
        power = r.mul_add(power, 1.0 / factorial);
    }
    power * f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3F80_0000))
}

/// `e^x`, to about one unit in the last place; what would overflow, or vanish, stays at the bound.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    /// Adding it leaves the nearest whole number in the last bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let x = x.clamp(-708.0, 709.0);
    // x = n ln 2 + r.
    let shifted = x.mul_add(std::f64::consts::LOG2_E, ROUND);
    let n = shifted - ROUND;
    let r = n.mul_add(-6.931_471_803_691_238e-1, x);
    let r = n.mul_add(-1.908_214_929_270_587_7e-10, r);
    let mut power = 1.0 / 6_227_020_800.0;
    for factorial in [
        479_001_600.0,
        39_916_800.0,
        3_628_800.0,
        362_880.0,
        40_320.0,
        5_040.0,
        720.0,
        120.0,
        24.0,
        6.0,
        2.0,
        1.0,
        1.0,
    ] {
        power = r.mul_add(power, 1.0 / factorial);
    }
    power * f64::from_bits((shifted.to_bits() << 52).wrapping_add(0x3FF0_0000_0000_0000))
}

/// `ln x` of a positive number that is not subnormal, to some units in the last place.
#[inline(always)]
pub(crate) fn ln(x: f64) -> f64 {
    const SQRT_HALF: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    const ONE: u64 = 1.0_f64.to_bits();
    // A whole number below 2^52 becomes a float by the bits of 2^52 before it.
    const WHOLE: u64 = 4_503_599_627_370_496.0_f64.to_bits();
    // x = 2^e m with m between the roots of a half and of two.
    let bits = x.to_bits();
    let exponent = bits.wrapping_add(ONE - SQRT_HALF) >> 52;
    let m = f64::from_bits(bits.wrapping_sub(exponent << 52).wrapping_add(ONE));
    let e = f64::from_bits(exponent | WHOLE) - (4_503_599_627_370_496.0 + 1023.0);
    // ln m = 2 artanh s, by its series.
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    let mut series = 1.0 / 21.0;
    for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        series = square.mul_add(series, 1.0 / odd);
    }
    let rest = (2.0 * s * square).mul_add(series, 2.0 * s);
    e.mul_add(6.931_471_803_691_238e-1, e.mul_add(1.908_214_929_270_587_7e-10, rest))
}

/// `ln x` of a positive number that is not subnormal, to within 2e-11: half the work of [`ln`].
#[inline(always)]
pub(crate) fn coarse_ln(x: f64) -> f64 {
    use std::f64::consts::{LN_2, SQRT_2};
    const MANTISSA: u64 = (1 << 52) - 1;
    const ONE: u64 = 1.0_f64.to_bits();
    // A whole number below 2^52 becomes a float by the bits of 2^52 before it.
    const WHOLE: u64 = 4_503_599_627_370_496.0_f64.to_bits();
    // x = 2^e m with m from one to two.
    let bits = x.to_bits();
    let e = f64::from_bits(bits >> 52 | WHOLE) - (4_503_599_627_370_496.0 + 1023.0);
    let m = f64::from_bits(bits & MANTISSA | ONE);
    // ln m = ln √2 + 2 artanh s, by its series.
    let s = (m - SQRT_2) / (m + SQRT_2);
    let square = s * s;
    let mut series = 2.0 / 11.0;
    for odd in [9.0, 7.0, 5.0, 3.0, 1.0] {
        series = square.mul_add(series, 2.0 / odd);
    }
    e.mul_add(LN_2, s.mul_add(series, 0.5 * LN_2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_and_logarithms_are_those_of_the_standard_library() {
        for step in -4000..4000 {
            let x = f64::from(step) * 0.02;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-15, "e^{x}");
            assert!((f64::from(exp_f32(x as f32)) / f64::from((x as f32).exp()) - 1.0).abs() < 3e-7, "e^{x}");
            let positive = (3.0 * x).exp();
            let error = (ln(positive) - positive.ln()).abs();
            assert!(error <= 1e-15 * positive.ln().abs().max(0.1), "ln {positive}");
            assert!((coarse_ln(positive) - positive.ln()).abs() < 2e-11, "ln {positive}");
        }
        assert_eq!((exp(0.0), exp_f32(0.0), ln(1.0)), (1.0, 1.0, 0.0));
        let near_one = 1.0 + 1e-9_f64;
        assert!((ln(near_one) / near_one.ln() - 1.0).abs() < 1e-15);
        assert!((1..4096).all(|k| {
            let x = 1.0 + f64::from(k) / 4096.0;
            (coarse_ln(x) - x.ln()).abs() < 2e-11
        }));
        assert!((ln(1e-300) / 1e-300_f64.ln() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn what_overflows_stays_at_the_bound_and_what_is_no_number_stays_none() {
        assert!(exp(1e4).is_finite() && exp(-1e4) < 1e-300 && exp_f32(-1e4) < 1e-37);
        assert!(exp(f64::NAN).is_nan() && exp_f32(f32::NAN).is_nan());
    }

    #[test]
    fn the_widest_instructions_give_the_same_numbers() {
        let numbers: Vec<f64> = (1..257).map(|k| 0.1 * f64::from(k)).collect();
        let narrow: Vec<f64> = numbers.iter().map(|x| exp(ln(*x) - 3.0)).collect();
        let wide: Vec<f64> = widest(
            #[inline(always)]
            || numbers.iter().map(|x| exp(ln(*x) - 3.0)).collect(),
        );
        assert_eq!(narrow, wide);
    }
}
