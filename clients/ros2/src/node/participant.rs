//! How the node takes part in DDS: domain, interfaces, and how services travel.

use std::net::{IpAddr, Ipv4Addr};

use ros2_client::dds::rustdds::DomainParticipantBuilder;
use ros2_client::{Context, ServiceMapping};

/// Where the other nodes are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Network {
    /// `ROS_DOMAIN_ID`.
    pub domain: u16,
    /// Whether only this machine is spoken to: `ROS_LOCALHOST_ONLY=1`, or `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`.
    pub is_local: bool,
    /// `RMW_IMPLEMENTATION`; empty where it is not set.
    pub rmw: String,
}

impl Network {
    /// As the environment says, by the variables that every node obeys.
    ///
    /// # Errors
    /// A domain that is none, in words.
    pub fn from_environment() -> Result<Self, String> {
        Self::from_variables(|name| std::env::var(name).ok())
    }

    fn from_variables(variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let domain = variable("ROS_DOMAIN_ID").filter(|value| !value.is_empty());
        let domain = domain.unwrap_or_else(|| "0".to_owned());
        let is_domain = |domain: &u16| *domain <= 232;
        Ok(Self {
            domain: domain
                .parse()
                .ok()
                .filter(is_domain)
                .ok_or_else(|| format!("ROS_DOMAIN_ID is {domain:?}: give a number from 0 to 232"))?,
            is_local: variable("ROS_LOCALHOST_ONLY").as_deref() == Some("1")
                || variable("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref() == Some("LOCALHOST"),
            rmw: variable("RMW_IMPLEMENTATION").unwrap_or_default(),
        })
    }

    pub(super) fn context(&self) -> Result<Context, String> {
        let mut builder = DomainParticipantBuilder::new(self.domain);
        if self.is_local {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let failed = |error: &dyn std::fmt::Display| format!("no DDS in domain {}: {error}", self.domain);
        let participant = builder.build().map_err(|error| failed(&error))?;
        Context::from_domain_participant(participant).map_err(|error| failed(&error))
    }

    /// How requests and replies are told apart, which each RMW does in its own way; `parameter` comes first.
    pub(super) fn service_mapping(&self, parameter: &str) -> Result<ServiceMapping, String> {
        match if parameter.is_empty() { &self.rmw } else { parameter } {
            "" | "rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_connextdds" => {
                Ok(ServiceMapping::Enhanced)
            }
            "rmw_cyclonedds_cpp" => Ok(ServiceMapping::Cyclone),
            other => Err(format!(
                "parameter rmw, or RMW_IMPLEMENTATION, is {other:?}: the bridge speaks to rmw_fastrtps_cpp, \
                 rmw_cyclonedds_cpp and rmw_connextdds"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(variables: &[(&str, &str)]) -> Result<Network, String> {
        let find =
            |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        Network::from_variables(find)
    }

    #[test]
    fn the_variables_of_every_node_are_obeyed() {
        let plain = Network { domain: 0, is_local: false, rmw: String::new() };
        assert_eq!(network(&[]), Ok(plain.clone()));
        assert_eq!(network(&[("ROS_DOMAIN_ID", "7")]).unwrap().domain, 7);
        assert!(network(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")]).unwrap().is_local);
        assert!(network(&[("ROS_LOCALHOST_ONLY", "1")]).unwrap().is_local);
        assert!(network(&[("ROS_DOMAIN_ID", "lab")]).unwrap_err().contains("ROS_DOMAIN_ID"));
        assert!(network(&[("ROS_DOMAIN_ID", "233")]).is_err());
    }

    #[test]
    fn services_travel_as_the_parameter_says_and_else_as_the_environment_says() {
        let cyclone = network(&[("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")]).unwrap();
        assert_eq!(cyclone.service_mapping(""), Ok(ServiceMapping::Cyclone));
        assert_eq!(cyclone.service_mapping("rmw_fastrtps_cpp"), Ok(ServiceMapping::Enhanced));
        assert_eq!(network(&[]).unwrap().service_mapping(""), Ok(ServiceMapping::Enhanced));
        assert!(cyclone.service_mapping("rmw_zenoh_cpp").unwrap_err().contains("rmw_zenoh_cpp"));
    }
}
