//! The `Accept` header: which of the media types on offer the caller prefers.

use http::HeaderMap;
use http::header::ACCEPT;

/// The offer that the caller prefers, ties going to the one offered first; `None` when it takes none of them.
/// A caller that says nothing takes everything.
pub(super) fn choose<T: Copy>(headers: &HeaderMap, offers: &[(&str, T)]) -> Option<T> {
    let ranges: Vec<Range> = headers
        .get_all(ACCEPT)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .filter_map(Range::parse)
        .collect();
    if ranges.is_empty() {
        return offers.first().map(|(_, offer)| *offer);
    }
    let mut best: Option<(f32, T)> = None;
    for (media_type, offer) in offers {
        // The most specific range decides, so that `model/ply;q=0, */*` means anything but PLY.
        let range =
            ranges.iter().filter(|range| range.matches(media_type)).max_by_key(|range| range.specificity());
        let quality = range.map_or(0.0, |range| range.quality);
        if quality > best.map_or(0.0, |(quality, _)| quality) {
            best = Some((quality, *offer));
        }
    }
    best.map(|(_, offer)| offer)
}

/// Whether the caller names `media_type` itself, not only by a wildcard.
pub(super) fn names(headers: &HeaderMap, media_type: &str) -> bool {
    choose(headers, &[(media_type, ())]).is_some()
        && headers
            .get_all(ACCEPT)
            .iter()
            .any(|value| value.to_str().is_ok_and(|value| value.contains(media_type)))
}

/// One media range with its quality value, in [0, 1].
struct Range<'a> {
    media_type: &'a str,
    quality: f32,
}

impl<'a> Range<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let mut parts = text.split(';').map(str::trim);
        let media_type = parts.next().filter(|media_type| !media_type.is_empty())?;
        let quality = parts.find_map(|part| part.strip_prefix("q=")?.parse().ok()).unwrap_or(1.0);
        Some(Self { media_type, quality })
    }

    fn matches(&self, media_type: &str) -> bool {
        match self.media_type.split_once('/') {
            Some(("*", "*")) => true,
            Some((family, "*")) => media_type.split('/').next() == Some(family),
            _ => self.media_type.eq_ignore_ascii_case(media_type),
        }
    }

    fn specificity(&self) -> u8 {
        match self.media_type {
            "*/*" => 0,
            family if family.ends_with("/*") => 1,
            _ => 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use http::HeaderValue;

    use super::*;

    const OFFERS: [(&str, &str); 3] =
        [("model/ply", "ply"), ("model/stl", "stl"), ("application/json", "json")];

    fn chosen(accept: &'static str) -> Option<&'static str> {
        let mut headers = HeaderMap::new();
        headers.insert(ACCEPT, HeaderValue::from_static(accept));
        choose(&headers, &OFFERS)
    }

    #[test]
    fn who_says_nothing_or_anything_gets_the_first_offer() {
        assert_eq!(choose(&HeaderMap::new(), &OFFERS), Some("ply"));
        assert_eq!(chosen("*/*"), Some("ply"));
        assert_eq!(chosen("text/html, */*;q=0.1"), Some("ply"));
    }

    #[test]
    fn the_best_liked_offer_wins() {
        assert_eq!(chosen("application/json"), Some("json"));
        assert_eq!(chosen("model/ply;q=0.2, model/stl;q=0.9"), Some("stl"));
        assert_eq!(chosen("model/*;q=0.5, application/json;q=0.4"), Some("ply"));
    }

    #[test]
    fn what_is_excluded_is_not_chosen() {
        assert_eq!(chosen("model/ply;q=0, */*;q=0.5"), Some("stl"));
        assert_eq!(chosen("text/html"), None);
    }

    #[test]
    fn a_wildcard_does_not_name_a_type() {
        let mut headers = HeaderMap::new();
        headers.insert(ACCEPT, HeaderValue::from_static("*/*"));
        assert!(!names(&headers, "text/event-stream"));
        headers.insert(ACCEPT, HeaderValue::from_static("text/event-stream"));
        assert!(names(&headers, "text/event-stream"));
    }
}
