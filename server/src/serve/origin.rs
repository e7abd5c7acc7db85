//! Web origins and names of hosts as they come in headers, so that what is allowed can match.

use http::uri::Authority;
use http::{HeaderValue, Uri};

/// Reads an origin: scheme, host and port.
///
/// # Errors
/// Whatever a browser would never send, with what to write instead.
pub fn parse_origin(text: &str) -> Result<HeaderValue, String> {
    match text {
        "*" => {
            return Err("would let every page of the web call; name the page's origin, such as \
                           http://localhost:5173"
                .to_owned());
        }
        "null" => {
            return Err("is what pages from a file send, whosever they are: serve the page, for instance \
                              with `python3 -m http.server`, and name its origin"
                .to_owned());
        }
        _ => {}
    }
    let Some((scheme, rest)) = text.split_once("://") else {
        return Err(format!("lacks its scheme: write http://{text} or https://{text}"));
    };
    let host = rest.split(['/', '?', '#']).next().unwrap_or_default();
    if host != rest {
        return Err(format!("ends with the host or its port: write {scheme}://{host}"));
    }
    let (scheme, host) = (scheme.to_ascii_lowercase(), host.to_ascii_lowercase());
    let known = match scheme.as_str() {
        "http" => Some(":80"),
        "https" => Some(":443"),
        _ => None,
    };
    if let Some(bare) = known.and_then(|port| host.strip_suffix(port)) {
        return Err(format!("has a port that browsers leave out: write {scheme}://{bare}"));
    }
    let origin = format!("{scheme}://{host}");
    let is_origin = origin.parse::<Uri>().is_ok() && !host.is_empty() && !host.contains(['@', '*']);
    match HeaderValue::from_str(&origin) {
        Ok(value) if is_origin => Ok(value),
        _ => Err("is no origin: write scheme, host and port, such as http://localhost:5173".to_owned()),
    }
}

/// Reads a name that the server is called by: a host without its port.
///
/// # Errors
/// Whatever is no such name, with what to write instead.
pub fn parse_host(text: &str) -> Result<String, String> {
    let Ok(authority) = text.parse::<Authority>() else {
        return Err("is no host: write a name or an address, such as palpate.lan".to_owned());
    };
    let host = authority.host();
    if text.contains(['@', '*']) {
        return Err("is no host: write one name or address, such as palpate.lan".to_owned());
    }
    if host != text {
        return Err(format!("has a port, and any port will do: write {host}"));
    }
    Ok(host.trim_end_matches('.').to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_taken_as_a_browser_sends_it() {
        for (typed, sent) in [
            ("http://localhost:5173", "http://localhost:5173"),
            ("https://Lab.Example", "https://lab.example"),
            ("http://[::1]:8080", "http://[::1]:8080"),
            ("tauri://localhost", "tauri://localhost"),
        ] {
            assert_eq!(parse_origin(typed).unwrap(), sent);
        }
    }

    #[test]
    fn what_would_never_match_is_refused_with_what_to_write() {
        for (typed, advice) in [
            ("*", "name the page's origin"),
            ("null", "serve the page"),
            ("localhost:5173", "write http://localhost:5173"),
            ("https://lab.example/", "write https://lab.example"),
            ("https://lab.example/page?x", "write https://lab.example"),
            ("http://lab.example:80", "write http://lab.example"),
            ("http://*.lab.example", "is no origin"),
            ("http://me@lab.example", "is no origin"),
            ("http://", "is no origin"),
            ("http://two words", "is no origin"),
        ] {
            let refusal = parse_origin(typed).unwrap_err();
            assert!(refusal.ends_with(advice) || refusal.contains(advice), "{typed}: {refusal}");
        }
    }

    #[test]
    fn a_host_is_a_name_without_a_port() {
        assert_eq!(parse_host("Palpate.LAN").unwrap(), "palpate.lan");
        assert_eq!(parse_host("[::2]").unwrap(), "[::2]");
        for (typed, advice) in [
            ("palpate.lan:7257", "write palpate.lan"),
            ("*", "is no host"),
            ("http://palpate.lan", "is no host"),
            ("me@palpate.lan", "is no host"),
            ("", "is no host"),
        ] {
            let refusal = parse_host(typed).unwrap_err();
            assert!(refusal.contains(advice), "{typed}: {refusal}");
        }
    }
}
