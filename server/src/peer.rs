//! Where a call comes from, as far as the connection knows; the one place that asks it.

use std::net::{IpAddr, Ipv6Addr};

use http::Extensions;
use tonic::transport::server::TcpConnectInfo;

/// The part of an IPv6 address that a network gives to one customer; the rest is theirs to choose.
const NETWORK_V6: u128 = u128::MAX << 64;

/// The caller's address, which every request carries that came over TCP.
pub(crate) fn address(extensions: &Extensions) -> Option<IpAddr> {
    extensions.get::<TcpConnectInfo>()?.remote_addr().map(|address| address.ip())
}

/// What counts as one machine where places are shared out: one address, or one network of IPv6.
pub(crate) fn machine(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() & NETWORK_V6).into(),
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_with_many_addresses_is_one_machine() {
        let machine = |text: &str| machine(text.parse().unwrap());
        assert_eq!(machine("2001:db8::1"), machine("2001:db8::ffff:1"));
        assert_ne!(machine("2001:db8::1"), machine("2001:db8:0:1::1"));
        assert_eq!(machine("::ffff:192.0.2.1"), machine("192.0.2.1"));
        assert_ne!(machine("192.0.2.1"), machine("192.0.2.2"));
    }
}
