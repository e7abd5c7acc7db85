//! Which server a command talks to, and as whom.

use std::path::{Path, PathBuf};

use palpate_client::{Client, ClientBuilder};

use crate::failure::Failure;
use crate::probe::{self, Credentials};

/// Where a token is kept that no list of processes shows.
const TOKEN: &str = "PALPATE_TOKEN";

/// The server.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ServerArgs {
    /// The server to talk to; https:// where it speaks TLS.
    #[arg(
        long = "server",
        env = "PALPATE_SERVER",
        value_name = "URL",
        default_value = "http://127.0.0.1:7257"
    )]
    #[arg(value_parser = address)]
    pub(super) url: String,

    #[command(flatten)]
    pub(super) caller: CallerArgs,
}

/// Who calls, and whom they trust.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Access")]
pub(super) struct CallerArgs {
    /// The file that holds the token to call with, as `palpate token create` prints it. The environment variable
    /// PALPATE_TOKEN may hold the token itself.
    #[arg(long, env = "PALPATE_TOKEN_FILE", value_name = "FILE")]
    token_file: Option<PathBuf>,

    /// The authority that the server's certificate comes from, in PEM, instead of those that the system trusts; for
    /// https://, as the next two.
    #[arg(long = "ca", env = "PALPATE_CA", value_name = "FILE")]
    authority: Option<PathBuf>,

    /// A certificate to call with, in PEM, where the server knows callers by theirs.
    #[arg(long, env = "PALPATE_CERTIFICATE", value_name = "FILE", requires = "key")]
    certificate: Option<PathBuf>,

    /// Its private key, in PEM.
    #[arg(long, env = "PALPATE_KEY", value_name = "FILE", requires = "certificate")]
    key: Option<PathBuf>,
}

impl ServerArgs {
    pub(super) async fn connect(&self) -> Result<Client, Failure> {
        Ok(self.caller.client(&self.url)?.connect().await?)
    }
}

impl CallerArgs {
    /// A client of the server at this address, which says who calls.
    pub(super) fn client(&self, url: &str) -> Result<ClientBuilder, Failure> {
        let Credentials { token, authority, identity } = self.credentials(url)?;
        let mut builder = Client::builder(url);
        if let Some(token) = token {
            builder = builder.token(&token);
        }
        if let Some(pem) = authority {
            builder = builder.certificate_authority(&pem);
        }
        if let Some((certificate, key)) = identity {
            builder = builder.certificate(&certificate, &key);
        }
        Ok(builder)
    }

    /// A plain HTTP client of the server at this address, which shows the same.
    pub(super) fn http(&self, url: &str) -> Result<reqwest::Client, Failure> {
        probe::client(&self.credentials(url)?)
    }

    /// Certificates are for https:// alone: a shell that is set up for a lab's server still calls others in the clear.
    fn credentials(&self, url: &str) -> Result<Credentials, Failure> {
        if !url.starts_with("https://") {
            return Ok(Credentials { token: self.token()?, ..Credentials::default() });
        }
        let authority = self.authority.as_ref().map(|path| read("--ca", path)).transpose()?;
        let identity = match (&self.certificate, &self.key) {
            (Some(certificate), Some(key)) => {
                Some((read("--certificate", certificate)?, read("--key", key)?))
            }
            _ => None,
        };
        Ok(Credentials { token: self.token()?, authority, identity })
    }

    fn token(&self) -> Result<Option<String>, Failure> {
        match &self.token_file {
            Some(path) => Ok(Some(read("--token-file", path)?)),
            None => Ok(std::env::var(TOKEN).ok().filter(|token| !token.trim().is_empty())),
        }
    }
}

fn read(flag: &str, path: &Path) -> Result<String, Failure> {
    Ok(std::fs::read_to_string(path).map_err(|error| format!("{flag} {}: {error}", path.display()))?)
}

/// An address of a server.
pub(super) fn address(text: &str) -> Result<String, String> {
    match text.split_once("://") {
        Some(("http" | "https", _)) => Ok(text.to_owned()),
        None => Ok(format!("http://{text}")),
        Some((scheme, rest)) => {
            Err(format!("{scheme}:// is not spoken here: write http://{rest}, or https://"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_address_is_completed_and_another_scheme_refused() {
        assert!(address("ftp://lab").unwrap_err().contains("write http://lab"));
        assert_eq!(address("127.0.0.1:7257"), Ok("http://127.0.0.1:7257".to_owned()));
        for right in ["http://lab:7257", "https://lab:7257"] {
            assert_eq!(address(right), Ok(right.to_owned()));
        }
    }

    #[test]
    fn a_file_that_is_not_there_is_named_with_its_flag() {
        let caller = CallerArgs { token_file: Some("/nowhere/token".into()), ..CallerArgs::default() };
        let failure = caller.client("http://127.0.0.1:1").unwrap_err().to_string();
        assert!(failure.contains("--token-file /nowhere/token"), "{failure}");
    }

    #[test]
    fn certificates_of_the_environment_leave_addresses_in_the_clear_alone() {
        let caller = CallerArgs { authority: Some("/nowhere/ca.pem".into()), ..CallerArgs::default() };
        assert!(caller.client("http://127.0.0.1:1").is_ok());
        let failure = caller.client("https://127.0.0.1:1").unwrap_err().to_string();
        assert!(failure.contains("--ca /nowhere/ca.pem"), "{failure}");
    }
}
