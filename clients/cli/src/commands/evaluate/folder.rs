//! The output folder: what is where, and whose evaluation it holds.

use std::path::{Path, PathBuf};

use super::Args;
use super::cases::series;
use super::objects::EvaluatedObject;
use crate::failure::Failure;

/// An output folder that exists and can be written.
#[derive(Clone, Debug)]
pub(super) struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Makes the folder, or goes on in one if that is wanted.
    pub(super) fn prepare(path: &Path, resume: bool) -> Result<Self, Failure> {
        let explain = |error: std::io::Error| format!("--out {}: {error}", path.display());
        for part in ["plots", "deviations"] {
            std::fs::create_dir_all(path.join(part)).map_err(explain)?;
        }
        let folder = Self { path: path.to_owned() };
        let path = path.display();
        if folder.database().exists() && !resume {
            let text = "holds an earlier evaluation: --resume goes on with it, another --out or the removal of \
                        that folder begins anew";
            return Err(format!("--out {path}: {text}").into());
        }
        if folder.database().exists() && !folder.arguments().exists() {
            return Err(format!("--out {path}: lacks arguments.txt, so it cannot be resumed").into());
        }
        Ok(folder)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn database(&self) -> PathBuf {
        self.path.join("sessions.db")
    }

    /// What decides the figures.
    fn arguments(&self) -> PathBuf {
        self.path.join("arguments.txt")
    }

    pub(super) fn runs(&self) -> PathBuf {
        self.path.join("runs.csv")
    }

    pub(super) fn attempts(&self) -> PathBuf {
        self.path.join("attempts.csv")
    }

    pub(super) fn table(&self) -> PathBuf {
        self.path.join("table.md")
    }

    /// What a run stated of each vertex, beside the truth.
    pub(super) fn deviations(&self, session_id: &str) -> PathBuf {
        self.path.join("deviations").join(format!("{session_id}.f32"))
    }

    pub(super) fn plot(&self, name: &str) -> PathBuf {
        self.path.join("plots").join(format!("{name}.svg"))
    }

    /// Keeps what decides the figures, or refuses to go on with something else.
    pub(super) fn claim(&self, arguments: &str) -> Result<(), Failure> {
        if !self.arguments().exists() {
            return Ok(std::fs::write(self.arguments(), arguments)?);
        }
        let earlier = std::fs::read_to_string(self.arguments())?;
        let absent = "nothing of the kind";
        let mut pairs = (0..earlier.lines().count().max(arguments.lines().count()))
            .map(|line| [&earlier, arguments].map(|text| text.lines().nth(line).unwrap_or(absent)));
        match pairs.find(|[earlier, now]| earlier != now) {
            None => Ok(()),
            Some([earlier, now]) => Err(format!(
                "--resume: the evaluation in {} was begun with `{earlier}`, and this is `{now}`; give the same \
                 arguments, or choose another --out",
                self.path.display()
            )
            .into()),
        }
    }
}

/// What decides the figures, a line each; neither how many runs go on at once, nor where they are written.
pub(super) fn arguments(args: &Args, objects: &[EvaluatedObject], algorithm_version: &str) -> String {
    let Args {
        meshes: _,
        scale: _,
        objects: _,
        strategies: _,
        methods: _,
        symmetry,
        template_axes,
        seeds,
        attempts,
        out: _,
        resume: _,
        jobs: _,
        sensors,
    } = args;
    let mut text = format!("algorithm: {algorithm_version}\nseeds: {seeds}\nattempts: {attempts}\n");
    let symmetry = symmetry.map_or("none", super::super::robot::name_of);
    let axes = template_axes.map_or("frame", super::super::robot::name_of);
    text.push_str(&format!("symmetry: {symmetry}\ntemplate axes: {axes}\nsensors: {sensors:?}\n"));
    for (method, strategy) in series(args) {
        text.push_str(&format!("series: {method}, {strategy}\n"));
    }
    for object in objects {
        // The floor is computed from the whole surface: another mesh has another one.
        text.push_str(&format!("object: {}, floor {:.6} mm\n", object.name, 1e3 * object.floor.sum_m));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::objects;
    use super::super::tests::typed;
    use super::*;

    #[test]
    fn an_earlier_evaluation_is_neither_overwritten_nor_mixed_with_another() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder::prepare(temporary.path(), false).unwrap();
        std::fs::write(folder.database(), "").unwrap();
        let refusal = Folder::prepare(temporary.path(), false).unwrap_err().to_string();
        assert!(refusal.contains("--resume goes on with it"), "{refusal}");
        assert!(Folder::prepare(temporary.path(), true).unwrap_err().to_string().contains("arguments.txt"));

        let objects = objects::load(None, 1.0, &["ball".to_owned()]).unwrap();
        let claim = |more: &[&str]| folder.claim(&arguments(&typed(more), &objects, "4"));
        claim(&[]).unwrap();
        claim(&["--jobs", "7"]).unwrap();
        Folder::prepare(temporary.path(), true).unwrap();
        let refusal = claim(&["--attempts", "9"]).unwrap_err().to_string();
        assert!(refusal.contains("`attempts: 50`") && refusal.contains("`attempts: 9`"), "{refusal}");
        assert!(claim(&["--methods", "paper"]).is_err() && claim(&["--depth-noise-mm", "1"]).is_err());
    }
}
