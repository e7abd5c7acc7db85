//! The methods, and every difference between them beside their own pages in `reconstruction/`.
//!
//! Each difference is an exhaustive match, so a third method cannot fall through: the compiler asks
//! for its answer to every question here.

/// How an object is reconstructed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The paper's stages, faithful and comparable.
    Paper,
    /// A Gaussian process implicit surface, as the paper's related work has it: for comparison.
    Gpis,
    /// Ahead of the paper: templates of several families and parts, space that was found free, and a
    /// Gaussian process with symmetry where there is any.
    #[default]
    Palpate,
}

/// METHOD_PALPATE counts as stalled after this many failures in a row where no rule is configured:
/// the paper explores a whole object with as many attempts.
const STALLED_AFTER: u32 = 50;

impl Method {
    /// Its name in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "METHOD_PAPER",
            Self::Gpis => "METHOD_GPIS",
            Self::Palpate => "METHOD_PALPATE",
        }
    }

    /// Whether a failed attempt changes the estimate. In the paper it does not (Section IV-B); it is
    /// evidence all the same: the path of a miss is free, and an early contact is the best
    /// measurement of all.
    pub(crate) fn learns_from_failures(self) -> bool {
        match self {
            Self::Paper => false,
            Self::Gpis | Self::Palpate => true,
        }
    }

    /// Whether a measured normal enters the fit.
    pub(crate) fn uses_normals(self) -> bool {
        match self {
            Self::Paper | Self::Gpis => false,
            Self::Palpate => true,
        }
    }

    /// Whether it states standard deviations, and with them a risk and an expected gain.
    pub(crate) fn states_deviations(self) -> bool {
        match self {
            Self::Paper | Self::Gpis => false,
            Self::Palpate => true,
        }
    }

    /// Whether it can use a symmetry that the caller vouches for.
    pub(crate) fn uses_symmetry(self) -> bool {
        match self {
            Self::Paper | Self::Gpis => false,
            Self::Palpate => true,
        }
    }

    /// Whether the caller chooses if the axes of its template turn.
    pub(crate) fn has_choice_of_axes(self) -> bool {
        match self {
            Self::Paper => true,
            Self::Gpis | Self::Palpate => false,
        }
    }

    /// Contacts after which a place that failed may be tried again; `None` for never. A failure changes
    /// nothing in the paper's estimate, and the paper says nothing of what to do then.
    pub(crate) fn taboo_contacts(self) -> Option<u32> {
        match self {
            Self::Paper | Self::Gpis => None,
            Self::Palpate => Some(3),
        }
    }

    /// Whether the choice of the highest uncertainty leaves out what has failed, too. The paper's baseline
    /// does not, and may be trapped (Section IV-B).
    pub(crate) fn baseline_leaves_out_failures(self) -> bool {
        match self {
            Self::Paper | Self::Palpate => false,
            Self::Gpis => true,
        }
    }

    /// Whether it is made of the ideas that `Stages` switches.
    pub(crate) fn has_stages(self) -> bool {
        match self {
            Self::Paper | Self::Gpis => false,
            Self::Palpate => true,
        }
    }

    /// Whether Eq. (3) gets the terms `template`, `risk` and `failures`.
    pub(crate) fn has_extra_terms(self) -> bool {
        match self {
            Self::Paper | Self::Gpis => false,
            Self::Palpate => true,
        }
    }

    /// Weight of the vertex uncertainty in Eq. (3) where none is configured.
    pub(crate) fn own_alpha_uncertainty(self) -> f64 {
        match self {
            Self::Paper | Self::Gpis => 1.0,
            Self::Palpate => 2.0,
        }
    }

    /// Failures in a row after which the exploration counts as stalled where none is configured. The
    /// paper's method may choose the same place for ever, and says nothing of when to give up.
    pub(crate) fn own_stall_limit(self) -> Option<u32> {
        match self {
            Self::Paper | Self::Gpis => None,
            Self::Palpate => Some(STALLED_AFTER),
        }
    }

    /// Whether it works in the frame of its first view. The axes of the paper's template are those of
    /// the session's frame or of the data, as its own formula says.
    pub(crate) fn works_in_view_frame(self) -> bool {
        match self {
            Self::Paper => false,
            Self::Gpis | Self::Palpate => true,
        }
    }
}
