//! `palpate serve`: the service on a port, until it is told to stop.

use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::process;

use axum::middleware::from_fn_with_state;
use clap::builder::FalseyValueParser;
use http::HeaderValue;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

use super::database::{DatabaseArgs, check_writable};
use super::{log_level, simulations};
use crate::config_file::ConfigFile;
use crate::failure::Failure;
use crate::limits;
use palpate_server::access::{Scope, require};
use palpate_server::{Limits, ServeOptions, TlsFiles, parse_host, parse_origin, serve};

/// The exit code of a process that was interrupted: 128 and the number of SIGINT.
const INTERRUPTED: i32 = 130;

pub(super) const ABOUT: &str = "\
Serves gRPC, gRPC-Web, HTTP with JSON, and server-sent events on one port.

Everything that is acknowledged is in the database: a server that was killed continues every session where it was. \
Ctrl-C or SIGTERM stops it gracefully: it finishes what it has begun and ends open streams; a second one stops at once.";

pub(super) const EXAMPLES: &str = "\
Examples:
  palpate serve --listen 127.0.0.1:0 --database /tmp/try.db
          a free port, and a database to throw away
  palpate serve --simulated-robots 4
          with robots that can be started from the page, to look around
  palpate serve --listen 0.0.0.0:7257 --tls-cert cert.pem --tls-key key.pem
          for the lab's network, with tokens made by `palpate token create`
  palpate serve --allow-origin http://localhost:5173
          for a web page that is developed on that port
  palpate serve --config palpate.toml
          as a file says; palpate config --show begins one";

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A file of settings, under the names of these flags with `_` for `-`; flags and environment win over it.
    #[arg(long, env = "PALPATE_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,

    /// Address and port; port 0 takes a free one and the log says which.
    #[arg(long, env = "PALPATE_LISTEN", value_name = "ADDRESS:PORT", default_value = "127.0.0.1:7257")]
    #[arg(value_parser = resolve)]
    pub(super) listen: SocketAddr,

    #[command(flatten)]
    pub(super) database: DatabaseArgs,

    /// Ask nobody who they are, on whatever address: anyone who reaches the port can then read and change every
    /// session. On the loopback that is so unless tokens are required.
    #[arg(long, conflicts_with_all = ["require_tokens", "client_ca"], help_heading = "Access")]
    insecure_open: bool,

    /// Ask callers for a token on the loopback, too; `palpate token create` makes them. On other addresses they are
    /// always asked.
    #[arg(long, env = "PALPATE_REQUIRE_TOKENS", help_heading = "Access", value_parser = FalseyValueParser::new())]
    require_tokens: bool,

    /// Speak TLS with this certificate, in PEM, with those up to its authority. It is read again when it changes.
    #[arg(long = "tls-cert", env = "PALPATE_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    #[arg(help_heading = "Access")]
    tls_cert: Option<PathBuf>,

    /// The private key of the certificate, in PEM.
    #[arg(long = "tls-key", env = "PALPATE_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    #[arg(help_heading = "Access")]
    tls_key: Option<PathBuf>,

    /// Let in who has a certificate of this authority, in PEM, without a token. Its common name says what its holder
    /// may do: SCOPE:NAME or SCOPE:NAME:EXPERIMENTS, such as robot:arm-1.
    #[arg(long = "tls-client-ca", env = "PALPATE_TLS_CLIENT_CA", value_name = "FILE", requires = "tls_cert")]
    #[arg(help_heading = "Access")]
    client_ca: Option<PathBuf>,

    /// A web origin whose pages may call this server, such as `https://lab.example`; several are comma separated,
    /// or each has its own flag.
    #[arg(long = "allow-origin", env = "PALPATE_ALLOW_ORIGIN", value_name = "ORIGIN", value_delimiter = ',')]
    #[arg(value_parser = parse_origin)]
    allowed_origins: Vec<HeaderValue>,

    /// A name that this server is called by, such as `palpate.lan`; the names of the loopback always count. On a
    /// loopback address no other name is taken; elsewhere any is, unless some are given.
    #[arg(long = "allow-host", env = "PALPATE_ALLOW_HOST", value_name = "HOST", value_delimiter = ',')]
    #[arg(value_parser = parse_host)]
    allowed_hosts: Vec<String>,

    /// How many simulated robots may run at a time, which whoever may call the server can then start from its page.
    #[arg(long, env = "PALPATE_SIMULATED_ROBOTS", value_name = "N", default_value_t = 0)]
    #[arg(value_parser = clap::value_parser!(u8).range(0..=simulations::MOST))]
    simulated_robots: u8,

    /// One of the bounds that keep the server well, such as `streams=512` or `drain=30s`; may be given several times.
    /// `palpate config --show` lists them all.
    #[arg(long = "limit", env = "PALPATE_LIMIT", value_name = "NAME=VALUE", value_delimiter = ',')]
    #[arg(value_parser = limits::pair)]
    pub(super) limits: Vec<(String, String)>,
}

impl Args {
    /// The bounds in force: the defaults, what the file says over them, and what the flags say over that.
    ///
    /// # Errors
    /// The file sets one that there is not, or a server cannot run within them.
    pub(super) fn limits(&self) -> Result<Limits, Failure> {
        let mut in_force = Limits::default();
        if let Some(path) = &self.config {
            let file = ConfigFile::read(path)?;
            in_force = limits::with(&in_force, file.limits.iter()).map_err(|refusal| file.blame(refusal))?;
        }
        let in_force = limits::with(&in_force, self.limits.iter())?;
        in_force.check().map_err(|refusal| format!("limits: {refusal}"))?;
        Ok(in_force)
    }
}

/// An address, or the first address of a name such as `localhost`.
fn resolve(text: &str) -> Result<SocketAddr, String> {
    let mut addresses = text.to_socket_addrs().map_err(|error| format!("{error}; say 127.0.0.1:7257"))?;
    addresses.next().ok_or_else(|| "the name has no address; say 127.0.0.1:7257".into())
}

/// Serves until a signal says stop.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let limits = args.limits()?;
    let Args {
        listen,
        database,
        insecure_open,
        require_tokens,
        tls_cert,
        tls_key,
        client_ca,
        allowed_origins,
        allowed_hosts,
        simulated_robots,
        ..
    } = args;
    let require_tokens = require_tokens || !(listen.ip().is_loopback() || insecure_open);
    let tls = tls_cert.zip(tls_key).map(|(certificate, key)| TlsFiles { certificate, key, client_ca });
    if tls.is_some() && simulated_robots > 0 {
        return Err("--simulated-robots call this server in the clear, and with --tls-cert it does not listen to that: \
                    leave one of them out"
            .into());
    }
    let database = database.location()?;
    check_writable("--database", &database)?;
    let listener = TcpListener::bind(listen).await.map_err(|error| explain_bind(listen, &error))?;
    tell_risks(listen, require_tokens, tls.is_some());
    let shutdown = CancellationToken::new();
    tokio::spawn(cancel_on_signal(shutdown.clone()));
    let additional_routes =
        simulations::router(listener.local_addr()?, simulated_robots.into(), shutdown.clone())
            .merge(log_level::router().route_layer(from_fn_with_state(Scope::Admin, require)));
    let options = ServeOptions {
        database,
        limits,
        allowed_origins,
        allowed_hosts,
        require_tokens,
        tls,
        additional_routes,
    };
    // It says itself where it listens, once the database is open.
    serve(listener, options, shutdown).await?;
    tracing::info!("stopped");
    Ok(())
}

/// Says what others on the network could do.
fn tell_risks(listen: SocketAddr, require_tokens: bool, is_encrypted: bool) {
    if listen.ip().is_loopback() {
        return;
    }
    if !require_tokens {
        tracing::warn!(%listen, "--insecure-open: whoever reaches this port can read and change every session");
    } else if !is_encrypted {
        tracing::warn!(
            %listen,
            "tokens come in the clear: give --tls-cert and --tls-key, unless what lies between is trusted or encrypts"
        );
    }
}

fn explain_bind(listen: SocketAddr, error: &std::io::Error) -> String {
    let port = listen.port();
    match error.kind() {
        ErrorKind::AddrInUse => format!(
            "port {port} is taken, perhaps by a server that runs already.\n\
             Use that one, stop it, or choose another port: --listen {}:{}, or port 0 for a free one.",
            listen.ip(),
            port.wrapping_add(1).max(1024),
        ),
        ErrorKind::PermissionDenied => {
            format!(
                "port {port} needs privileges: choose one above 1023, such as --listen {}:7257.",
                listen.ip()
            )
        }
        ErrorKind::AddrNotAvailable => {
            format!(
                "{} is no address of this machine: 127.0.0.1 is itself, 0.0.0.0 all of its addresses.",
                listen.ip()
            )
        }
        _ => format!("cannot listen on {listen}: {error}"),
    }
}

/// Cancels at the first signal and ends the process at the second.
async fn cancel_on_signal(shutdown: CancellationToken) {
    if let Err(error) = next_signal().await {
        tracing::error!(%error, "signals cannot be heard: only killing the process will stop it");
        return;
    }
    tracing::info!("stopping: finishing what has begun; a second signal stops at once");
    shutdown.cancel();
    if next_signal().await.is_ok() {
        process::exit(INTERRUPTED);
    }
}

#[cfg(unix)]
async fn next_signal() -> std::io::Result<()> {
    let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
    tokio::select! {
        result = tokio::signal::ctrl_c() => result,
        _ = terminate.recv() => Ok(()),
    }
}

#[cfg(not(unix))]
async fn next_signal() -> std::io::Result<()> {
    tokio::signal::ctrl_c().await
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(clap::Parser)]
    struct Serve {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn without_flags_only_this_machine_is_served() {
        let Serve { args } = Serve::parse_from(["serve"]);
        assert!(args.listen.ip().is_loopback() && !args.insecure_open && !args.require_tokens);
        assert!(args.allowed_origins.is_empty());
    }

    #[test]
    fn a_name_is_as_good_as_an_address() {
        assert!(resolve("localhost:7257").unwrap().ip().is_loopback());
        assert!(resolve("7257").is_err());
    }

    #[test]
    fn what_contradicts_itself_is_refused() {
        for wrong in [
            ["--insecure-open", "--require-tokens"].as_slice(),
            &["--tls-cert", "cert.pem"],
            &["--tls-client-ca", "ca.pem"],
        ] {
            assert!(Serve::try_parse_from([&["serve"], wrong].concat()).is_err(), "{wrong:?}");
        }
    }

    #[tokio::test]
    async fn a_taken_port_is_explained() {
        let first = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = first.local_addr().unwrap();
        let error = TcpListener::bind(address).await.unwrap_err();
        let text = explain_bind(address, &error);
        assert!(text.contains(&format!("port {} is taken", address.port())), "{text}");
    }
}
