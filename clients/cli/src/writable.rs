//! Whether a file can be written, asked before the work whose result it is to hold.

use std::fs::OpenOptions;
use std::path::Path;

use crate::failure::Failure;

/// Refuses a file that cannot be written, in the words of the flag that names it; leaves no trace.
///
/// # Errors
/// It is a folder, its folder is missing or closed, or the file itself may not be changed.
pub(crate) fn check(flag: &str, file: &Path) -> Result<(), Failure> {
    let refuse = |what: String| Err(format!("{flag} {}: {what}", file.display()).into());
    if file.is_dir() {
        return refuse("is a folder; name a file in it".to_owned());
    }
    // A bare name lies in the current folder.
    let folder = match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return refuse(format!("there is no folder {}; make it first", folder.display()));
    }
    if let Err(error) = tempfile::tempfile_in(folder) {
        return refuse(format!("nothing can be written to its folder: {}", error.kind()));
    }
    if file.exists()
        && let Err(error) = OpenOptions::new().append(true).open(file)
    {
        return refuse(format!("it cannot be changed: {}", error.kind()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_is_said_in_words_and_what_can_leaves_no_trace() {
        let folder = tempfile::tempdir().unwrap();
        let refusal = |file: &Path| check("--out", file).unwrap_err().to_string();
        assert!(refusal(folder.path()).ends_with("is a folder; name a file in it"));
        let missing = refusal(&folder.path().join("no/such.ply"));
        assert!(missing.starts_with("--out ") && missing.contains("there is no folder"), "{missing}");
        // Not even a privileged user makes files there.
        #[cfg(target_os = "linux")]
        assert!(refusal(Path::new("/proc/such.ply")).contains("nothing can be written to its folder"));
        check("--out", &folder.path().join("such.ply")).unwrap();
        check("--out", Path::new("such.ply")).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(!Path::new("such.ply").exists());
    }
}
