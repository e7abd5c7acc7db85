//! Which server a command talks to.

use palpate_client::Client;

use crate::failure::Failure;

/// The server.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ServerArgs {
    /// The server to talk to.
    #[arg(
        long = "server",
        env = "PALPATE_SERVER",
        value_name = "URL",
        default_value = "http://127.0.0.1:7257"
    )]
    #[arg(value_parser = address)]
    pub(super) url: String,
}

impl ServerArgs {
    pub(super) async fn connect(&self) -> Result<Client, Failure> {
        Ok(Client::connect(&self.url).await?)
    }
}

/// An address of a server; encrypted ones are refused, as nothing would be encrypted.
pub(super) fn address(text: &str) -> Result<String, String> {
    match text.split_once("://") {
        Some(("https", rest)) => Err(format!(
            "this version does not speak TLS: write http://{rest} if the way there may be read by others, or let a \
             tunnel encrypt it, such as `ssh -L 7257:127.0.0.1:7257 HOST`"
        )),
        Some(("http", _)) => Ok(text.to_owned()),
        None => Ok(format!("http://{text}")),
        Some((scheme, rest)) => Err(format!("{scheme}:// is not spoken here: write http://{rest}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_encrypted_address_is_refused_and_a_bare_one_is_completed() {
        assert!(address("https://127.0.0.1:7257").unwrap_err().contains("write http://127.0.0.1:7257"));
        assert!(address("ftp://lab").unwrap_err().contains("write http://lab"));
        assert_eq!(address("127.0.0.1:7257"), Ok("http://127.0.0.1:7257".to_owned()));
        assert_eq!(address("http://lab:7257"), Ok("http://lab:7257".to_owned()));
    }
}
