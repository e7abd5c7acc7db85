//! Who has the port of a server.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener};

use super::finding::Findings;
use super::server::ask;
use crate::commands::server::CallerArgs;

/// Whether a server can listen there, or listens already.
pub(super) async fn report(listen: SocketAddr, is_held: bool, findings: &mut Findings) {
    if listen.port() == 0 {
        findings.ok("port", "a free one is taken at the start");
        return;
    }
    let error = match TcpListener::bind(listen) {
        Ok(_) if is_held => {
            let text = format!("{listen} is free, while a server holds the database");
            findings.warn("port", text, "it listens elsewhere: name its address with --listen");
            return;
        }
        Ok(_) => {
            findings.ok("port", format!("{listen} is free"));
            return;
        }
        Err(error) => error,
    };
    match error.kind() {
        ErrorKind::AddrInUse => taken(listen, is_held, findings).await,
        ErrorKind::PermissionDenied => {
            let text = format!("{listen} needs privileges");
            findings.problem(
                "port",
                text,
                "choose a port above 1023, or give the program CAP_NET_BIND_SERVICE",
            );
        }
        _ => findings.problem(
            "port",
            format!("{listen} cannot be listened on: {error}"),
            "choose an address of this machine",
        ),
    }
}

/// What a server there tells a stranger of its version; nothing where it is no palpate.
async fn version_at(url: &str) -> Option<String> {
    let client = CallerArgs::default().http(url).ok()?;
    let said = ask(&client, url, "/version").await.ok()?.json;
    let is_guarded =
        matches!(said["reason"].as_str(), Some("TOKEN_MISSING" | "TOKEN_INVALID" | "TLS_NEEDED"));
    let version = said["version"].as_str().map(str::to_owned);
    version.or_else(|| is_guarded.then(|| "that asks who calls".to_owned()))
}

async fn taken(listen: SocketAddr, is_held: bool, findings: &mut Findings) {
    let by = holder(listen.port()).map(|holder| format!(" by {holder}")).unwrap_or_default();
    let version = version_at(&format!("http://{}", reached_at(listen))).await;
    match (version, is_held) {
        (Some(version), true) => findings.ok("port", format!("palpate {version} answers at {listen}{by}")),
        (Some(version), false) => findings.warn(
            "port",
            format!("palpate {version} answers at {listen}{by}, and does not hold this database"),
            "name its database with --database, or choose another port for a second server",
        ),
        (None, _) => findings.problem(
            "port",
            format!("{listen} is taken{by}, which is no palpate that answers"),
            "stop it, or choose another port with --listen",
        ),
    }
}

/// Where a server is reached that listens on this address.
fn reached_at(listen: SocketAddr) -> SocketAddr {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listen.port())
}

/// The process that listens on a port, as far as Linux tells this user.
fn holder(port: u16) -> Option<String> {
    let inode = ["/proc/net/tcp", "/proc/net/tcp6"].iter().find_map(|table| {
        let table = std::fs::read_to_string(table).ok()?;
        table.lines().find_map(|line| listening_inode(line, port)).map(str::to_owned)
    })?;
    let socket = format!("socket:[{inode}]");
    for process in std::fs::read_dir("/proc").ok()?.flatten() {
        // There are others than processes, such as `self`.
        if process.file_name().to_string_lossy().parse::<u32>().is_err() {
            continue;
        }
        let Ok(files) = std::fs::read_dir(process.path().join("fd")) else { continue };
        let has_it = |file: std::fs::DirEntry| {
            std::fs::read_link(file.path()).is_ok_and(|target| target.as_os_str() == socket.as_str())
        };
        if files.flatten().any(has_it) {
            let name = std::fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            return Some(format!("{} (process {})", name.trim(), process.file_name().to_string_lossy()));
        }
    }
    None
}

/// The inode of a socket in the kernel's table, where it listens on the port.
fn listening_inode(line: &str, port: u16) -> Option<&str> {
    let columns: Vec<&str> = line.split_whitespace().collect();
    let (local, state, inode) = (columns.get(1)?, columns.get(3)?, columns.get(9)?);
    // 0A is the state of a socket that listens.
    (local.ends_with(&format!(":{port:04X}")) && *state == "0A").then_some(inode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_that_listens_is_found_in_the_kernels_table() {
        let line = "   0: 0100007F:1C59 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 424242 1";
        assert_eq!(listening_inode(line, 7257), Some("424242"));
        assert_eq!(listening_inode(line, 7258), None);
        assert_eq!(listening_inode(&line.replace(" 0A ", " 01 "), 7257), None);
    }

    #[test]
    fn the_process_that_listens_here_is_this_one() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let holder = holder(listener.local_addr().unwrap().port());
        #[cfg(target_os = "linux")]
        assert!(holder.unwrap().ends_with(&format!("(process {})", std::process::id())));
        #[cfg(not(target_os = "linux"))]
        assert_eq!(holder, None);
    }
}
