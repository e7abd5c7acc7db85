//! Which program this is.

use std::sync::LazyLock;

/// The release, and the commit where the build knew it: `0.1.0 (633a012abc)`.
pub(crate) static VERSION: LazyLock<String> = LazyLock::new(|| match option_env!("PALPATE_COMMIT") {
    Some(commit) => format!("{} ({commit})", env!("CARGO_PKG_VERSION")),
    None => env!("CARGO_PKG_VERSION").to_owned(),
});
