//! The rows: every idea in use, and then each left out in turn.

use palpate_core::config::Stages;
use palpate_simulator::objects::Problem;

/// A choice of stages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// The switch of the idea that is left out; empty where none is.
    idea: &'static str,
    /// What the row is called.
    pub(crate) name: &'static str,
    pub(crate) stages: Stages,
}

/// Everything in use, and then the named ideas left out in turn; all of them without names.
pub(crate) fn choices(ideas: &[String]) -> Result<Vec<Choice>, Problem> {
    let all = all();
    let known: Vec<&str> = all[1..].iter().map(|choice| choice.idea).collect();
    if let Some(unknown) = ideas.iter().find(|idea| !known.contains(&idea.as_str())) {
        return Err(format!("--ideas: {unknown:?} is none of {}", known.join(", ")).into());
    }
    let is_wanted = |idea: &str| idea.is_empty() || ideas.is_empty() || ideas.iter().any(|i| i == idea);
    Ok(all.into_iter().filter(|choice| is_wanted(choice.idea)).collect())
}

fn all() -> Vec<Choice> {
    let all = Stages::default();
    let row = |idea, name, stages| Choice { idea, name, stages };
    vec![
        row("", "everything", all),
        row("superquadrics", "no superquadrics: one ellipsoid", Stages { superquadrics: false, ..all }),
        row("slab", "no slab to start from", Stages { slab: false, ..all }),
        row("extent", "no regard to how far the measurements reach", Stages { extent: false, ..all }),
        row("parts", "no parts", Stages { parts: false, ..all }),
        row("limbs", "no limbs: free parts only", Stages { limbs: false, ..all }),
        row("free_space", "no free space", Stages { free_space: false, ..all }),
        row("pressure", "pads touch with their centre", Stages { pressure: false, ..all }),
        row("doubts", "no touch is doubted", Stages { doubts: false, ..all }),
        row("offsets", "views are never off as a whole", Stages { offsets: false, ..all }),
        row("motion", "the object never moves", Stages { motion: false, ..all }),
        row("early_contacts", "early contacts not kept", Stages { early_contacts: false, ..all }),
        row("visual_means", "visual points not averaged", Stages { visual_means: false, ..all }),
        row("noise", "noise not estimated", Stages { noise: false, ..all }),
        row("symmetry", "no symmetry", Stages { symmetry: false, ..all }),
        row("symmetry_first", "no symmetry ordering", Stages { symmetry_first: false, ..all }),
        row("failure_penalty", "no penalty near failures", Stages { failure_penalty: false, ..all }),
        row("template_error", "no template-uncertainty term", Stages { template_error: false, ..all }),
        row("risk", "no risk term", Stages { risk: false, ..all }),
    ]
}
