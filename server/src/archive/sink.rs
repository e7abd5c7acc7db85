//! Where the writer of recordings writes to: memory that is emptied while it writes.

use std::io::{self, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes on their way; clones share them.
#[derive(Clone, Debug, Default)]
pub(super) struct Sink(Arc<Mutex<Written>>);

#[derive(Debug, Default)]
struct Written {
    waiting: Vec<u8>,
    /// Bytes that were taken already.
    taken: u64,
}

impl Sink {
    /// What was written since the last time.
    pub(super) fn take(&self) -> Vec<u8> {
        let mut written = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        written.taken += written.waiting.len() as u64;
        std::mem::take(&mut written.waiting)
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).waiting.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Sink {
    /// It can be asked where it is, and goes nowhere else.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let written = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let end = written.taken + written.waiting.len() as u64;
        match to {
            SeekFrom::Current(0) | SeekFrom::End(0) => Ok(end),
            SeekFrom::Start(place) if place == end => Ok(end),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
