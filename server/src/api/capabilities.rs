//! What a server can do, in words for programs: taken from the contract's enums, so that no value is forgotten.

use palpate_proto::v1;

use crate::wire::from_proto;

/// What no enum of the contract names.
const FEATURES: [&str; 9] =
    ["keep_out", "support", "symmetry", "explore", "watch", "lease", "pads", "contacts", "import"];

/// The capabilities that `ServerInfo` lists, such as `method:paper`.
pub(super) fn capabilities() -> Vec<String> {
    let encodings = values().filter(|&encoding| from_proto::is_readable(encoding));
    let methods = values().map(|value: v1::Method| named("method", "METHOD_", value.as_str_name()));
    let strategies = values().map(|value: v1::Strategy| named("strategy", "STRATEGY_", value.as_str_name()));
    let symmetries = values().map(|value: v1::Symmetry| named("symmetry", "SYMMETRY_", value.as_str_name()));
    let points = encodings.map(|value| named("points", "POINT_ENCODING_", value.as_str_name()));
    let exports =
        values().map(|value: v1::ArchiveFormat| named("export", "ARCHIVE_FORMAT_", value.as_str_name()));
    let features = FEATURES.map(str::to_owned);
    methods.chain(strategies).chain(symmetries).chain(points).chain(exports).chain(features).collect()
}

/// All values of an enum but the unspecified one, whose number is 0.
fn values<E: TryFrom<i32>>() -> impl Iterator<Item = E> {
    (1..).map_while(|number| E::try_from(number).ok())
}

fn named(group: &str, prefix: &str, name: &str) -> String {
    format!("{group}:{}", name.strip_prefix(prefix).unwrap_or(name).to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_strategy_and_readable_encoding_is_listed() {
        let capabilities = capabilities();
        for expected in [
            "method:paper",
            "method:palpate",
            "strategy:min_uncertainty",
            "strategy:expected_gain",
            "symmetry:revolution",
            "points:xyz_f32_le",
            "points:ply",
            "points:pcd",
            "points:packed",
            "points:depth_u16",
            "points:depth_png",
            "export:bundle",
            "export:mcap",
            "export:csv",
            "watch",
        ] {
            assert!(capabilities.iter().any(|name| name == expected), "{expected}");
        }
        assert!(!capabilities.iter().any(|name| name.contains("unspecified")));
    }
}
