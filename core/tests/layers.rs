//! The rooms of the method and what each may look into: no circle, no arrow upwards.

#![expect(clippy::unwrap_used, reason = "a test that meets nothing where something must be has failed")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// From the ground up: a room may use those above it in this list, and nothing below.
const FLOORS: [&str; 20] = [
    "error",
    "warning",
    "vectorised",
    "geometry",
    "mesh_file",
    "fingerprint",
    "arithmetic",
    "metrics",
    "schedule",
    "method",
    "config",
    "evidence",
    "symmetry",
    "template",
    "local",
    "implicit",
    "uncertainty",
    "exploration",
    "reconstruction",
    "lib",
];

fn floor(room: &str) -> usize {
    FLOORS.iter().position(|name| *name == room).unwrap_or_else(|| {
        panic!("{room} is a new room: give it its floor here and its line in ARCHITECTURE.md")
    })
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// A file's text up to its tests: what they use is no dependency of the method.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    text.split("#[cfg(test)]").next().unwrap().to_owned()
}

/// The first name after each `crate::` or `super::` of a text.
fn names_after<'a>(text: &'a str, prefix: &str) -> Vec<&'a str> {
    let is_end = |c: char| !c.is_alphanumeric() && c != '_';
    let after = text.match_indices(prefix).map(|(at, _)| &text[at + prefix.len()..]);
    after.map(|rest| rest.split(is_end).next().unwrap()).filter(|name| !name.is_empty()).collect()
}

#[test]
fn no_room_looks_into_one_above_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    for file in files {
        let inside = file.strip_prefix(&root).unwrap().with_extension("");
        let room = inside.iter().next().unwrap().to_str().unwrap();
        for other in names_after(&code(&file), "crate::") {
            let is_allowed = other == room || floor(other) <= floor(room);
            assert!(is_allowed, "{} uses {other}, which is built on it", file.display());
        }
    }
}

#[test]
fn the_files_of_a_room_use_each_other_without_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for room in ["template", "local", "exploration", "evidence", "geometry", "mesh_file", "uncertainty"] {
        let mut files = Vec::new();
        sources(&root.join(room), &mut files);
        let name = |file: &PathBuf| file.file_stem().unwrap().to_str().unwrap().to_owned();
        let names: BTreeSet<String> = files.iter().map(name).collect();
        let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for file in &files {
            let text = code(file);
            let others = names_after(&text, "use super::").into_iter().map(str::to_owned);
            uses.insert(name(file), others.filter(|other| names.contains(other)).collect());
        }
        // What uses nothing that is left can be taken away, until nothing is left.
        while !uses.is_empty() {
            let free: Vec<String> =
                uses.iter().filter(|(_, others)| others.is_empty()).map(|(name, _)| name.clone()).collect();
            assert!(!free.is_empty(), "{room}: a circle among {uses:?}");
            free.iter().for_each(|name| _ = uses.remove(name));
            uses.values_mut().for_each(|others| others.retain(|other| !free.contains(other)));
        }
    }
}
