//! Builds the page with npm, in the folder of cargo's own output, and embeds it.
//!
//! Without Node, or with `PALPATE_DASHBOARD=off`, a page that says how to get it is embedded in its place. Where npm is
//! there and fails, so does this.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;
use std::{env, fs, io};

/// What the page is made of; anything else is left alone.
const SOURCES: [&str; 9] = [
    ".npmrc",
    "index.html",
    "openapi.json",
    "package.json",
    "package-lock.json",
    "public",
    "src",
    "tsconfig.json",
    "vite.config.ts",
];

fn main() {
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo says where the package is"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo says where output goes")).join("page");
    for source in SOURCES.iter().chain(&["without-npm"]) {
        println!("cargo::rerun-if-changed={}", here.join(source).display());
    }
    println!("cargo::rerun-if-env-changed=PALPATE_DASHBOARD");

    let page = if env::var("PALPATE_DASHBOARD").is_ok_and(|wish| wish == "off") {
        here.join("without-npm")
    } else if !has_node() {
        println!(
            "cargo::warning=without Node 20 or newer and npm, / has no dashboard: install it, \
             `cargo clean -p palpate-dashboard`, build again"
        );
        here.join("without-npm")
    } else {
        built(&here, &out).unwrap_or_else(|error| panic!("the dashboard could not be built: {error}"))
    };
    memory_serve::load_directory_with_embed(page, true);
}

/// Whether npm is there, and a Node that is new enough for what builds the page.
fn has_node() -> bool {
    let major = |program| {
        let output = Command::new(program).arg("--version").output().ok()?;
        let text = String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?;
        text.trim().trim_start_matches('v').split('.').next()?.parse::<u32>().ok()
    };
    major("npm").is_some() && major("node").is_some_and(|version| version >= 20)
}

/// The folder with the page that npm made of copies of the sources.
fn built(here: &Path, out: &Path) -> io::Result<PathBuf> {
    let lock = |folder: &Path| fs::read(folder.join("package-lock.json")).ok();
    let is_installed = lock(here) == lock(out) && out.join("node_modules/.bin/vite").exists();
    for source in SOURCES {
        let (from, to) = (here.join(source), out.join(source));
        if to.is_dir() {
            fs::remove_dir_all(&to)?;
        }
        copy(&from, &to)?;
    }
    if !is_installed {
        npm(out, &["ci"])?;
    }
    npm(out, &["run", "build"])?;
    let page = out.join("dist");
    make_old(&page)?;
    Ok(page)
}

/// Sets the times of what was built to the distant past: cargo builds again what became newer than the start of this.
fn make_old(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            make_old(&entry?.path())?;
        }
    }
    fs::File::open(path)?.set_modified(SystemTime::UNIX_EPOCH)
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    if from.is_dir() {
        fs::create_dir_all(to)?;
        for entry in fs::read_dir(from)? {
            let entry = entry?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::copy(from, to).map(drop)
}

fn npm(folder: &Path, arguments: &[&str]) -> io::Result<()> {
    let output = Command::new("npm").args(arguments).current_dir(folder).output()?;
    if output.status.success() {
        return Ok(());
    }
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text);
    Err(io::Error::other(format!("npm {} failed:\n{text}", arguments.join(" "))))
}
