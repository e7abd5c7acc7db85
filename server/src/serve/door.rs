//! Who is let in: requests for this server by one of its names, and no web page of a site that may not call.
//!
//! A page can make its own name mean this machine (DNS rebinding), and can send requests here blindly. Either shows in
//! headers that a page cannot forge: `Host`, `Origin` and `Sec-Fetch-Site`. Robots send neither of the last two.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::Router;
use axum::extract::Request;
use axum::response::Response;
use http::header::{HOST, ORIGIN};
use http::request::Parts;
use http::uri::Authority;
use http::{HeaderValue, Method, Version};
use tower::ServiceExt;

use super::{bodies, headers};
use crate::access::guard;
use crate::error::Error;
use crate::limits::Limits;

/// What HTTP/2 adds to the length of each header when it counts them.
const HEADER_OVERHEAD_BYTES: usize = 32;
/// A name is repeated to the caller, and in the log, up to this many characters.
const SHOWN_CHARACTERS: usize = 100;

/// The rules of one server; cheap to clone.
#[derive(Clone, Debug)]
pub(super) struct Door(Arc<Rules>);

#[derive(Debug)]
struct Rules {
    /// The names that the server is called by beside those of the loopback; `None` where any will do.
    hosts: Option<Vec<String>>,
    origins: Vec<HeaderValue>,
    header_bytes: usize,
}

/// Whose request it is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Caller {
    /// A program, or a page of this server.
    Own,
    /// A page of an allowed origin.
    AllowedPage,
}

impl Door {
    /// On the loopback only its own names and `hosts` are taken; elsewhere any name, unless some are given.
    pub(super) fn new(
        address: SocketAddr,
        hosts: Vec<String>,
        origins: Vec<HeaderValue>,
        limits: &Limits,
    ) -> Self {
        let any_name = !address.ip().to_canonical().is_loopback() && hosts.is_empty();
        Self(Arc::new(Rules {
            hosts: (!any_name).then_some(hosts),
            origins,
            header_bytes: limits.header_bytes as usize,
        }))
    }

    /// The answer of the router to a request that is let in, or a refusal; either with the headers that guard a page.
    pub(super) async fn pass(self, request: Request, router: Router) -> Response {
        let (parts, body) = request.into_parts();
        match self.0.check(&parts) {
            Ok(caller) => {
                let Ok(mut response) = router.oneshot(Request::from_parts(parts, body)).await;
                headers::guard(response.headers_mut(), caller == Caller::AllowedPage);
                response
            }
            Err(error) => {
                tracing::info!(method = %parts.method, path = parts.uri.path(), %error, "refused at the door");
                let refusal = guard::refusal(&parts.headers, &error);
                let mut response = bodies::unread(&parts, refusal);
                headers::guard(response.headers_mut(), false);
                response
            }
        }
    }
}

impl Rules {
    fn check(&self, parts: &Parts) -> Result<Caller, Error> {
        self.check_size(parts)?;
        let host = self.check_host(parts)?;
        self.check_page(parts, host.as_ref())
    }

    fn check_size(&self, parts: &Parts) -> Result<(), Error> {
        let headers = parts.headers.iter();
        let headers: usize =
            headers.map(|(name, value)| name.as_str().len() + value.len() + HEADER_OVERHEAD_BYTES).sum();
        let target = parts.uri.path_and_query().map_or(0, |target| target.as_str().len());
        let bytes = headers + target;
        if bytes > self.header_bytes {
            return Err(Error::HeaderTooLarge { bytes, limit: self.header_bytes });
        }
        Ok(())
    }

    /// The name that the request is for; none where HTTP/1.0 leaves it out.
    fn check_host(&self, parts: &Parts) -> Result<Option<Authority>, Error> {
        let mut named = parts.headers.get_all(HOST).iter();
        let header = named.next().map(|value| authority(value.as_bytes())).transpose()?;
        let is_missing =
            header.is_none() && parts.uri.authority().is_none() && parts.version > Version::HTTP_10;
        if is_missing || named.next().is_some() {
            return Err(Error::HostMissing);
        }
        // Where both are there the target counts, but neither may be another server's.
        for host in parts.uri.authority().into_iter().chain(&header) {
            self.check_name(host)?;
        }
        Ok(parts.uri.authority().cloned().or(header))
    }

    fn check_name(&self, authority: &Authority) -> Result<(), Error> {
        let Some(hosts) = &self.hosts else { return Ok(()) };
        let name = authority.host().trim_end_matches('.').to_ascii_lowercase();
        let has_user = authority.as_str().contains('@');
        if !has_user && (is_loopback(&name) || hosts.contains(&name)) {
            return Ok(());
        }
        Err(Error::HostRefused { host: shown(authority.as_str()) })
    }

    fn check_page(&self, parts: &Parts, host: Option<&Authority>) -> Result<Caller, Error> {
        if let Some(origin) = parts.headers.get(ORIGIN) {
            if self.origins.contains(origin) {
                return Ok(Caller::AllowedPage);
            }
            if is_same_origin(origin, host) {
                return Ok(Caller::Own);
            }
            let site = shown(&String::from_utf8_lossy(origin.as_bytes()));
            // Quoted, which also escapes what a terminal would obey.
            return Err(Error::OriginRefused { site: format!("{site:?}") });
        }
        // A browser that sends no origin still says whether the page is of another site.
        let says = |name: &str| parts.headers.get(name).map_or(&b""[..], HeaderValue::as_bytes);
        let is_foreign = matches!(says("sec-fetch-site"), b"cross-site" | b"same-site");
        // A link that somebody follows, as opposed to what a page loads or shows in a frame.
        let is_link = says("sec-fetch-mode") == b"navigate" && says("sec-fetch-dest") == b"document";
        if is_foreign && !(is_link && matches!(parts.method, Method::GET | Method::HEAD)) {
            return Err(Error::OriginRefused { site: "another site".to_owned() });
        }
        Ok(Caller::Own)
    }
}

fn authority(value: &[u8]) -> Result<Authority, Error> {
    Authority::try_from(value)
        .map_err(|_| Error::HostRefused { host: shown(&String::from_utf8_lossy(value)) })
}

/// The loopback by address or by a name that no resolver may give to another machine (RFC 6761).
fn is_loopback(name: &str) -> bool {
    let address = name.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(name);
    match address.parse::<IpAddr>() {
        Ok(address) => address.to_canonical().is_loopback(),
        Err(_) => name == "localhost" || name.ends_with(".localhost"),
    }
}

/// Whether a page is of this server, as it was called: a proxy may have turned `https` into `http`.
fn is_same_origin(origin: &HeaderValue, host: Option<&Authority>) -> bool {
    let origin = origin.to_str().unwrap_or_default();
    let (origin, port) = match origin.split_once("://") {
        Some(("http", rest)) => (rest, 80),
        Some(("https", rest)) => (rest, 443),
        _ => return false,
    };
    let (Ok(origin), Some(host)) = (origin.parse::<Authority>(), host) else { return false };
    let port_of = |authority: &Authority| authority.port_u16().unwrap_or(port);
    origin.host().eq_ignore_ascii_case(host.host()) && port_of(&origin) == port_of(host)
}

/// What a caller sent, short enough to be repeated.
fn shown(text: &str) -> String {
    text.chars().take(SHOWN_CHARACTERS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(address: &str, hosts: &[&str]) -> Door {
        let hosts = hosts.iter().map(|&host| host.to_owned()).collect();
        let origins = vec![HeaderValue::from_static("https://lab.example")];
        Door::new(address.parse().unwrap(), hosts, origins, &Limits::default())
    }

    fn check(door: &Door, headers: &[(&str, &str)]) -> Result<Caller, &'static str> {
        let mut request = http::Request::get("/v1/sessions");
        for &(name, value) in headers {
            request = request.header(name, value);
        }
        door.0.check(&request.body(()).unwrap().into_parts().0).map_err(|error| error.reason())
    }

    #[test]
    fn the_loopback_is_called_by_its_own_names_and_by_those_it_was_given() {
        let door = rules("127.0.0.1:7257", &["palpate.lan"]);
        for host in [
            "localhost",
            "LOCALHOST:80",
            "localhost.",
            "127.0.0.1:50051",
            "127.8.9.1",
            "[::1]:7257",
            "app.localhost:1",
            "palpate.lan:7257",
        ] {
            assert_eq!(check(&door, &[("host", host)]), Ok(Caller::Own), "{host}");
        }
        for host in [
            "evil.example",
            "evil.example:7257",
            "localhost.evil.example",
            "notlocalhost",
            "10.0.0.1",
            "0.0.0.0:7257",
            "localhost@evil.example",
            "evil@localhost",
            "/run/palpate.sock",
            "palpate.lan.evil.example",
            "",
        ] {
            assert_eq!(check(&door, &[("host", host)]), Err("HOST_REFUSED"), "{host}");
        }
        assert_eq!(check(&door, &[]), Err("HOST_MISSING"));
        assert_eq!(check(&door, &[("host", "localhost"), ("host", "localhost")]), Err("HOST_MISSING"));
    }

    #[test]
    fn beyond_the_loopback_any_name_will_do_unless_some_are_given() {
        assert!(check(&rules("0.0.0.0:1", &[]), &[("host", "robots.example")]).is_ok());
        let named = rules("0.0.0.0:1", &["palpate.lan"]);
        assert!(check(&named, &[("host", "Palpate.LAN:7257")]).is_ok());
        assert!(check(&named, &[("host", "localhost")]).is_ok(), "probes from the same machine");
        assert_eq!(check(&named, &[("host", "robots.example")]), Err("HOST_REFUSED"));
    }

    #[test]
    fn the_target_and_the_header_are_both_looked_at() {
        let door = rules("127.0.0.1:1", &[]);
        let request =
            http::Request::get("http://evil.example/").header("host", "localhost").body(()).unwrap();
        assert!(door.0.check(&request.into_parts().0).is_err());
        let request =
            http::Request::get("http://localhost/").header("host", "evil.example").body(()).unwrap();
        assert!(door.0.check(&request.into_parts().0).is_err());
    }

    #[test]
    fn a_page_is_of_this_server_or_of_an_allowed_origin() {
        let door = rules("127.0.0.1:7257", &[]);
        let from = |host, origin| check(&door, &[("host", host), ("origin", origin)]);
        assert_eq!(from("localhost:7257", "http://localhost:7257"), Ok(Caller::Own));
        assert_eq!(from("localhost", "https://localhost"), Ok(Caller::Own));
        assert_eq!(from("localhost:80", "http://localhost"), Ok(Caller::Own));
        assert_eq!(from("[::1]:7257", "http://[::1]:7257"), Ok(Caller::Own));
        assert_eq!(from("localhost", "https://lab.example"), Ok(Caller::AllowedPage));
        for origin in ["http://localhost:5173", "http://127.0.0.1:7257", "null", "https://evil.example", "x"]
        {
            assert_eq!(from("localhost:7257", origin), Err("ORIGIN_REFUSED"), "{origin}");
        }
    }

    #[test]
    fn a_link_may_be_followed_but_another_site_loads_and_frames_nothing() {
        let door = rules("127.0.0.1:7257", &[]);
        let from = |site, mode, dest| {
            let said = [("host", "localhost"), ("sec-fetch-site", site), ("sec-fetch-mode", mode)];
            check(&door, &[&said[..], &[("sec-fetch-dest", dest)]].concat())
        };
        assert_eq!(from("cross-site", "navigate", "document"), Ok(Caller::Own));
        assert_eq!(from("same-origin", "no-cors", "image"), Ok(Caller::Own));
        assert_eq!(from("none", "navigate", "document"), Ok(Caller::Own));
        for (site, mode, dest) in [
            ("cross-site", "no-cors", "image"),
            ("same-site", "no-cors", "image"),
            ("cross-site", "navigate", "iframe"),
        ] {
            assert_eq!(from(site, mode, dest), Err("ORIGIN_REFUSED"), "{site} {mode} {dest}");
        }
    }
}
