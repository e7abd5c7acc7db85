//! A plain HTTP client, for what has no place in the contract: probes and what only operators ask.

use std::sync::Arc;
use std::time::Duration;

use http::header::AUTHORIZATION;
use http::{HeaderMap, HeaderValue};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ClientConfig, RootCertStore};

use crate::failure::Failure;

/// A server that takes longer for a short answer is not well.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Whom the client trusts, and what it shows; all in PEM.
#[derive(Default)]
pub(crate) struct Credentials {
    /// A token.
    pub(crate) token: Option<String>,
    /// The authority of the server's certificate, instead of those that the system trusts.
    pub(crate) authority: Option<String>,
    /// A certificate and its private key.
    pub(crate) identity: Option<(String, String)>,
}

/// The client.
///
/// # Errors
/// What it should show or trust cannot be used.
pub(crate) fn client(credentials: &Credentials) -> Result<reqwest::Client, Failure> {
    let mut headers = HeaderMap::new();
    if let Some(token) = &credentials.token {
        let mut value = HeaderValue::from_str(&format!("Bearer {}", token.trim()))?;
        value.set_sensitive(true);
        headers.insert(AUTHORIZATION, value);
    }
    // A proxy of the environment would answer for the server that is asked about.
    let builder = reqwest::Client::builder().timeout(TIMEOUT).no_proxy().default_headers(headers);
    Ok(builder.tls_backend_preconfigured(tls(credentials)?).build()?)
}

fn tls(credentials: &Credentials) -> Result<ClientConfig, Failure> {
    let mut roots = RootCertStore::empty();
    match &credentials.authority {
        Some(pem) => {
            for authority in certificates(pem)? {
                roots.add(authority)?;
            }
        }
        // One that cannot be read is one that is not trusted.
        None => drop(roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs)),
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions()?;
    let builder = builder.with_root_certificates(roots);
    Ok(match &credentials.identity {
        None => builder.with_no_client_auth(),
        Some((certificate, key)) => {
            let key =
                PrivateKeyDer::from_pem_slice(key.as_bytes()).map_err(|error| format!("--key: {error}"))?;
            builder.with_client_auth_cert(certificates(certificate)?, key)?
        }
    })
}

fn certificates(pem: &str) -> Result<Vec<CertificateDer<'static>>, Failure> {
    let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(pem.as_bytes()).collect();
    Ok(all.map_err(|error| format!("a certificate cannot be read: {error}"))?)
}

/// What is at the bottom of an error, such as "connection refused".
pub(crate) fn cause(error: &(dyn std::error::Error + 'static)) -> String {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    cause.to_string()
}
