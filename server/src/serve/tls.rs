//! TLS from PEM files, which may be replaced while the server runs: new connections then use the new ones.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rustls::pki_types::pem::{self, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig};
use sha2::{Digest, Sha256};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio::sync::watch;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_util::sync::CancellationToken;
use x509_parser::prelude::{FromDer, X509Certificate};

use super::stall::Patient;
use crate::access::CertificateName;

/// How often it is looked whether the files have changed.
const LOOK: Duration = Duration::from_secs(2);
/// How a connection begins that speaks TLS: the type of a handshake record.
const HANDSHAKE: u8 = 0x16;
/// What a caller reads who speaks plain HTTP/1 to a port that is encrypted.
const IN_THE_CLEAR: &str = r#"{"type":"about:blank","title":"Bad Request","status":400,"detail":"this port speaks TLS: write https:// instead of http://","reason":"TLS_NEEDED","fields":[]}"#;

/// The files of a server that speaks TLS, all in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The server's certificate, and those up to its authority.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// Whose clients' certificates are trusted: such a client needs no token. None where no client has one.
    pub client_ca: Option<PathBuf>,
}

/// Why a server cannot speak TLS with the files that it was given.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file cannot be read, or is not what it should be.
    #[error("{path:?} cannot be used as {role}: {reason}")]
    File {
        /// The file.
        path: PathBuf,
        /// What it should be.
        role: &'static str,
        /// What is the matter.
        reason: String,
    },
    /// The files do not fit to each other.
    #[error("the certificate {certificate:?} and the key {key:?} cannot be used together: {reason}")]
    Pair {
        /// The certificate.
        certificate: PathBuf,
        /// The key.
        key: PathBuf,
        /// What is the matter.
        reason: String,
    },
}

/// What new connections are accepted with.
#[derive(Clone, Debug)]
pub(super) struct Tls {
    config: watch::Receiver<Arc<ServerConfig>>,
}

impl Tls {
    /// Reads the files, and reads them again when they change, until `stopping`. What cannot be used then is told, and
    /// changes nothing.
    ///
    /// # Errors
    /// They cannot be used.
    pub(super) fn start(files: TlsFiles, stopping: CancellationToken) -> Result<Self, TlsError> {
        let (config, receiver) = watch::channel(Arc::new(read(&files)?));
        let mut seen = digest(&files);
        let mut looks = tokio::time::interval(LOOK);
        tokio::spawn(async move {
            while stopping.run_until_cancelled(looks.tick()).await.is_some() {
                let now = digest(&files);
                if now == seen {
                    continue;
                }
                seen = now;
                match read(&files) {
                    Ok(new) => {
                        tracing::info!(certificate = %files.certificate.display(), "TLS goes on with the new files");
                        config.send_replace(Arc::new(new));
                    }
                    Err(error) => tracing::error!(%error, "TLS goes on with the files of before"),
                }
            }
        });
        Ok(Self { config: receiver })
    }

    /// Encrypts a connection. One that begins in the clear is told so, in words.
    ///
    /// # Errors
    /// The peer speaks something else, or trusts nothing here.
    pub(super) async fn accept(
        &self,
        mut stream: TcpStream,
        send_timeout: Duration,
    ) -> io::Result<TlsStream<Patient>> {
        let mut first = [0];
        if stream.peek(&mut first).await? == 1 && first[0] != HANDSHAKE {
            let answer = format!(
                "HTTP/1.1 400 Bad Request\r\ncontent-type: application/problem+json\r\nconnection: close\r\n\
                 content-length: {}\r\n\r\n{IN_THE_CLEAR}",
                IN_THE_CLEAR.len()
            );
            stream.write_all(answer.as_bytes()).await?;
            stream.shutdown().await?;
            return Err(io::Error::new(io::ErrorKind::InvalidData, "the peer does not speak TLS"));
        }
        let config = self.config.borrow().clone();
        TlsAcceptor::from(config).accept(Patient::new(stream, send_timeout)).await
    }
}

/// What the client's certificate, which the handshake has checked, calls its holder: its common name.
pub(super) fn client_name(stream: &TlsStream<Patient>) -> Option<CertificateName> {
    let certificate = stream.get_ref().1.peer_certificates()?.first()?;
    let (_, certificate) = X509Certificate::from_der(certificate).ok()?;
    let name = certificate.subject().iter_common_name().next()?.as_str().ok()?;
    Some(CertificateName(name.into()))
}

fn read(files: &TlsFiles) -> Result<ServerConfig, TlsError> {
    let TlsFiles { certificate, key, client_ca } = files;
    let chain = certificates(certificate, "the server's certificate")?;
    let private =
        PrivateKeyDer::from_pem_file(key).map_err(|error| unusable(key, "its private key", &error))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let pair = |error: rustls::Error| TlsError::Pair {
        certificate: certificate.clone(),
        key: key.clone(),
        reason: error.to_string(),
    };
    let builder = ServerConfig::builder_with_provider(provider.clone());
    let builder = builder.with_safe_default_protocol_versions().map_err(pair)?;
    let builder = match client_ca {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let role = "the authority of clients";
            let mut roots = RootCertStore::empty();
            for authority in certificates(path, role)? {
                let added = roots.add(authority);
                added.map_err(|error| unusable(path, role, &error))?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider);
            // Whoever has no certificate may have a token.
            let verifier = verifier.allow_unauthenticated().build();
            builder.with_client_cert_verifier(verifier.map_err(|error| unusable(path, role, &error))?)
        }
    };
    let mut config = builder.with_single_cert(chain, private).map_err(pair)?;
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    Ok(config)
}

fn certificates(path: &Path, role: &'static str) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let read = CertificateDer::pem_file_iter(path).and_then(Iterator::collect::<Result<Vec<_>, pem::Error>>);
    let read = read.map_err(|error| unusable(path, role, &error))?;
    if read.is_empty() { Err(unusable(path, role, &"there is no certificate in it")) } else { Ok(read) }
}

fn unusable(path: &Path, role: &'static str, reason: &impl ToString) -> TlsError {
    TlsError::File { path: path.to_owned(), role, reason: reason.to_string() }
}

/// Tells the files of now from those of before.
fn digest(files: &TlsFiles) -> Vec<u8> {
    let mut digest = Sha256::new();
    for path in [Some(&files.certificate), Some(&files.key), files.client_ca.as_ref()].into_iter().flatten() {
        // One that cannot be read is told when it is used.
        digest.update(std::fs::read(path).unwrap_or_default());
        digest.update([0]);
    }
    digest.finalize().to_vec()
}
