//! Builds the page with npm from its lock file and lists what came of it for `lib.rs`.
//!
//! Without npm, or with `PALPATE_NO_DASHBOARD` set, the list is empty. A build of the page that fails is an error.

use std::collections::hash_map::DefaultHasher;
use std::env;
use std::fmt::Write;
use std::fs;
use std::hash::Hasher;
use std::io::Result;
use std::path::{Path, PathBuf};
use std::process::Command;

const SOURCES: [&str; 8] = [
    ".npmrc",
    "compress.mjs",
    "index.html",
    "openapi.json",
    "package-lock.json",
    "package.json",
    "page",
    "tsconfig.json",
];
const NPM: &str = if cfg!(windows) { "npm.cmd" } else { "npm" };

fn main() -> Result<()> {
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
    }
    println!("cargo::rerun-if-changed=vite.config.ts");
    println!("cargo::rerun-if-env-changed=PATH");
    println!("cargo::rerun-if-env-changed=PALPATE_NO_DASHBOARD");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let mut files = Vec::new();
    if env::var_os("PALPATE_NO_DASHBOARD").is_some() {
        println!("cargo::warning=PALPATE_NO_DASHBOARD is set: the server is built without its page");
    } else if Command::new(NPM).arg("--version").output().is_err() {
        println!(
            "cargo::warning=npm is not installed: the server is built without its page; install Node.js 20"
        );
    } else {
        let folder = out.join("page-build");
        if folder.join("page").exists() {
            fs::remove_dir_all(folder.join("page"))?;
        }
        for source in SOURCES.into_iter().chain(["vite.config.ts"]) {
            copy(Path::new(source), &folder.join(source))?;
        }
        npm(&folder, &["ci", "--no-audit", "--no-fund"]);
        npm(&folder, &["run", "build"]);
        list(&folder.join("dist"), &mut files)?;
        files.sort();
        return fs::write(out.join("assets.rs"), table(&folder.join("dist"), &files)?);
    }
    fs::write(out.join("assets.rs"), table(&out, &files)?)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    if !from.is_dir() {
        fs::create_dir_all(to.parent().expect("it is in a folder"))?;
        return fs::copy(from, to).map(drop);
    }
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        if entry.file_name() != "generated" {
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
    }
    Ok(())
}

fn npm(folder: &Path, args: &[&str]) {
    let output = Command::new(NPM).args(args).current_dir(folder).output().expect("npm was found");
    assert!(
        output.status.success(),
        "npm {} failed:\n{}\n{}",
        args.join(" "),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, files)?;
        } else if !path.extension().is_some_and(|extension| extension == "br" || extension == "gz") {
            files.push(path);
        }
    }
    Ok(())
}

fn table(root: &Path, files: &[PathBuf]) -> Result<String> {
    let mut text = "pub(crate) static ASSETS: &[Asset] = &[\n".to_owned();
    for file in files {
        let name = file.strip_prefix(root).expect("it is below").to_string_lossy().replace('\\', "/");
        let path = if name == "index.html" { "/".to_owned() } else { format!("/{name}") };
        let mut hasher = DefaultHasher::new();
        hasher.write(&fs::read(file)?);
        let etag = format!("{:016x}", hasher.finish());
        let packed = |suffix: &str| {
            let packed = PathBuf::from(format!("{}{suffix}", file.display()));
            if packed.exists() { format!("Some(include_bytes!({packed:?}))") } else { "None".to_owned() }
        };
        writeln!(
            text,
            "Asset {{ path: {path:?}, etag: {etag:?}, plain: include_bytes!({file:?}), brotli: {}, gzip: {} }},",
            packed(".br"),
            packed(".gz")
        )
        .expect("a string grows");
    }
    text.push_str("];\n");
    Ok(text)
}
