//! `palpate export`: a session as a file.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use palpate_client::Download;
use palpate_client::proto::v1::{ArchiveFormat, ExportSessionRequest};
use tokio::fs::File;
use tokio::io::AsyncWriteExt;

use super::server::ServerArgs;
use crate::failure::Failure;
use crate::terminal::say;
use crate::writable;

pub(super) const ABOUT: &str = "\
Writes a session into a file: a bundle that another server imports and a paper can attach, a table of all attempts, or \
an MCAP recording for Foxglove and others.

For instance: palpate export mug-1 --out mug-1.palpate.tar";

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// All that another server needs to import the session.
    Bundle,
    /// One row per attempt.
    Csv,
    /// For robotics viewers.
    Mcap,
}

impl Format {
    fn of_the_contract(self) -> ArchiveFormat {
        match self {
            Self::Bundle => ArchiveFormat::Bundle,
            Self::Csv => ArchiveFormat::Csv,
            Self::Mcap => ArchiveFormat::Mcap,
        }
    }

    fn ending(self) -> &'static str {
        match self {
            Self::Bundle => "palpate.tar",
            Self::Csv => "csv",
            Self::Mcap => "mcap",
        }
    }
}

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The session.
    session: String,

    #[command(flatten)]
    server: ServerArgs,

    /// What to write.
    #[arg(long, value_enum, default_value = "bundle")]
    format: Format,

    /// The last revision that is in the file; all unless given.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    revision: i64,

    /// Where to write it; a file of the session's name unless given.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the file, or none.
pub(crate) async fn run(args: Args) -> Result<(), Failure> {
    let Args { session, server, format, revision, out } = args;
    let out = out.unwrap_or_else(|| PathBuf::from(format!("{session}.{}", format.ending())));
    writable::check("--out", &out)?;
    let client = server.connect().await?;
    let format = format.of_the_contract().into();
    let download =
        client.export_session(ExportSessionRequest { session_id: session, revision, format }).await?;
    // Under another name until it is whole: a file of that name is never a part of one.
    let part = out.with_added_extension("part");
    let written = write(download, &part).await;
    let bytes = match written {
        Ok(bytes) => bytes,
        Err(failure) => {
            let _ = tokio::fs::remove_file(&part).await;
            return Err(failure);
        }
    };
    tokio::fs::rename(&part, &out).await?;
    say(format_args!("{}: {bytes} bytes", out.display()))
}

async fn write(mut download: Download, file: &Path) -> Result<u64, Failure> {
    let mut out = File::create(file).await?;
    let mut bytes = 0;
    while let Some(data) = download.next().await? {
        bytes += data.len() as u64;
        out.write_all(&data).await?;
    }
    out.sync_all().await?;
    Ok(bytes)
}
