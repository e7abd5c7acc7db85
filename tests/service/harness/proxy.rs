//! An address that stays while servers behind it come and go, so that no test races for a port.

use std::net::SocketAddr;

use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

/// Forwards connections to a server that can be exchanged.
#[derive(Debug)]
pub(crate) struct Proxy {
    address: SocketAddr,
    behind: watch::Sender<SocketAddr>,
}

impl Proxy {
    pub(crate) async fn to(server: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (behind, server) = watch::channel(server);
        tokio::spawn(async move {
            while let Ok((near, _)) = listener.accept().await {
                tokio::spawn(forward(near, server.clone()));
            }
        });
        Self { address, behind }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Cuts all connections, and sends new ones to another server.
    pub(crate) fn switch(&self, server: SocketAddr) {
        self.behind.send_replace(server);
    }
}

/// Where nobody listens, the connection just ends, as it does with a process that was killed.
async fn forward(mut near: TcpStream, mut server: watch::Receiver<SocketAddr>) {
    let address = *server.borrow_and_update();
    if let Ok(mut far) = TcpStream::connect(address).await {
        tokio::select! {
            _ = copy_bidirectional(&mut near, &mut far) => {}
            _ = server.changed() => {}
        }
    }
}
