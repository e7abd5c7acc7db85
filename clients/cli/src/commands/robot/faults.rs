//! Arguments that say what goes wrong: what real robots do, so that robustness is measured as accuracy is.

use palpate_simulator::faults::{Faults, Motion};

use super::sensors::not_negative;
use crate::failure::{Failure, wrong_usage};

/// So much of a view at least must show the object.
const LEAST_OBJECT_SHARE: f64 = 0.1;

/// What goes wrong; nothing, unless told otherwise.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Faults")]
pub(in crate::commands) struct FaultArgs {
    /// This share of the approaches reports a contact in the air, before anything is touched: shown as `false`,
    /// counted neither as a hit nor as a failure.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    false_contacts: f64,

    /// The object is pushed aside after this attempt; errors are measured against where it stands then.
    #[arg(long, value_name = "N")]
    move_after: Option<u32>,

    /// How far it is pushed, across the table in any direction.
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 20.0,
        value_parser = not_negative,
        requires = "move_after"
    )]
    move_mm: f64,

    /// How far camera and robot base disagree: all that is seen is off by one vector of this length, in any direction.
    #[arg(long, value_name = "MM", default_value_t = 0.0, value_parser = not_negative)]
    hand_eye_mm: f64,

    /// How far the camera looks elsewhere than the robot believes: all that is seen is turned about it by this angle.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = not_negative)]
    hand_eye_deg: f64,

    /// This share of the seen points lies on the table around the object; 0.25 unless a share is given.
    #[arg(long, value_name = "SHARE", num_args = 0..=1, default_missing_value = "0.25", value_parser = share)]
    table: Option<f64>,

    /// This share of the seen points are flying pixels, 5 to 40 mm behind the edge of what is seen; 0.05 unless a
    /// share is given.
    #[arg(long, value_name = "SHARE", num_args = 0..=1, default_missing_value = "0.05", value_parser = share)]
    flying_pixels: Option<f64>,

    /// This share of the seen points are pixels without depth, all at the camera itself; 0.05 unless a share is given.
    #[arg(long, value_name = "SHARE", num_args = 0..=1, default_missing_value = "0.05", value_parser = share)]
    zeros: Option<f64>,
}

impl FaultArgs {
    /// Refuses a view of something else than the object.
    pub(in crate::commands) fn check(&self) -> Result<(), Failure> {
        let Faults { table_share, flying_pixel_share, zero_share, .. } = self.faults();
        if table_share + flying_pixel_share + zero_share > 1.0 - LEAST_OBJECT_SHARE + 1e-9 {
            return Err(wrong_usage(
                "--table, --flying-pixels and --zeros together leave less than a tenth of the view to the object: \
                 give them smaller shares",
            ));
        }
        Ok(())
    }

    /// The same for the robot.
    pub(in crate::commands) fn faults(&self) -> Faults {
        let Self {
            false_contacts,
            move_after,
            move_mm,
            hand_eye_mm,
            hand_eye_deg,
            table,
            flying_pixels,
            zeros,
        } = *self;
        Faults {
            false_contact_share: false_contacts,
            move_after: move_after.map(|attempt| Motion { attempt, distance_m: 1e-3 * move_mm }),
            hand_eye_m: 1e-3 * hand_eye_mm,
            hand_eye_turn: hand_eye_deg.to_radians(),
            table_share: table.unwrap_or_default(),
            flying_pixel_share: flying_pixels.unwrap_or_default(),
            zero_share: zeros.unwrap_or_default(),
        }
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("must be between 0 and 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(args: &[&str]) -> Result<FaultArgs, clap::Error> {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            faults: FaultArgs,
        }
        let program = <Program as clap::Parser>::try_parse_from([&["palpate"], args].concat());
        program.map(|program| program.faults)
    }

    #[test]
    fn nothing_goes_wrong_unless_it_is_asked_for() {
        let faults = typed(&[]).unwrap().faults();
        assert!(!faults.any(), "{faults:?}");
    }

    #[test]
    fn a_fault_has_a_usual_size_and_may_have_another() {
        let usual = typed(&["--table", "--flying-pixels", "--zeros", "--move-after", "15"]).unwrap().faults();
        assert_eq!((usual.table_share, usual.flying_pixel_share, usual.zero_share), (0.25, 0.05, 0.05));
        assert_eq!(usual.move_after, Some(Motion { attempt: 15, distance_m: 0.02 }));
        let other = ["--table", "0.4", "--move-after", "3", "--move-mm", "5", "--hand-eye-mm", "8"];
        let other = typed(&other).unwrap().faults();
        assert_eq!((other.table_share, other.hand_eye_m, other.zero_share), (0.4, 0.008, 0.0));
        assert_eq!(other.move_after, Some(Motion { attempt: 3, distance_m: 0.005 }));
        let turned = typed(&["--hand-eye-deg", "0.5"]).unwrap().faults();
        assert!((turned.hand_eye_turn - 0.5_f64.to_radians()).abs() < 1e-12 && turned.hand_eye_m == 0.0);
        assert_eq!(typed(&["--false-contacts", "0.1"]).unwrap().faults().false_contact_share, 0.1);
    }

    #[test]
    fn faults_that_cannot_be_are_refused_in_the_words_of_the_flags() {
        let refusal = typed(&["--false-contacts", "10"]).unwrap_err().to_string();
        assert!(refusal.contains("between 0 and 1"), "{refusal}");
        assert!(typed(&["--move-mm", "5"]).unwrap_err().to_string().contains("--move-after"));
        typed(&["--table", "0.5", "--zeros", "0.4"]).unwrap().check().unwrap();
        let refusal = typed(&["--table", "0.5", "--zeros", "0.5"]).unwrap().check().unwrap_err().to_string();
        assert!(refusal.contains("a tenth of the view"), "{refusal}");
    }
}
