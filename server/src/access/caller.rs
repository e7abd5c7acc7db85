//! Who calls, once that is known.

use std::net::IpAddr;
use std::sync::Arc;

use http::Extensions;

use super::scope::Scope;
use crate::error::Error;
use crate::peer;
use crate::store::TicketRow;

/// Who calls, and what they may do; cheap to clone.
#[derive(Clone, Debug)]
pub struct Caller(Arc<Known>);

#[derive(Debug)]
struct Known {
    actor: String,
    scope: Scope,
    experiments: Option<String>,
    account: Account,
}

/// On whose account computations go: those of one token share what it is due.
#[derive(Clone, Debug, PartialEq)]
pub struct Account {
    /// The token's id; empty where there is none.
    pub token_id: Arc<str>,
    /// Its part of the threads where all want them, as others have 1.
    pub share: f64,
}

impl Default for Account {
    fn default() -> Self {
        Self { token_id: Arc::from(""), share: 1.0 }
    }
}

/// The name in a client's certificate, which the connection has checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CertificateName(pub(crate) Arc<str>);

impl Caller {
    pub(crate) fn new(actor: String, scope: Scope, experiments: Option<String>, account: Account) -> Self {
        Self(Arc::new(Known { actor, scope, experiments, account }))
    }

    /// Whoever calls a server that asks nobody: it is known by its address.
    pub(crate) fn anyone(address: Option<IpAddr>) -> Self {
        let actor = address.map(|address| address.to_string()).unwrap_or_default();
        Self::new(actor, Scope::Admin, None, Account::default())
    }

    /// By the name of a certificate: a scope, a name, and the experiments that it is kept to, such as `robot:arm-1` or
    /// `read:wall:mugs`.
    ///
    /// # Errors
    /// The name is not of that form.
    pub(crate) fn by_certificate(name: &CertificateName) -> Result<Self, Error> {
        let parts: Vec<&str> = name.0.splitn(3, ':').collect();
        let (scope, name, experiments) = match parts.as_slice() {
            [scope, name] if !name.is_empty() => (*scope, *name, None),
            [scope, name, prefix] if !name.is_empty() => (*scope, *name, Some((*prefix).to_owned())),
            _ => return Err(Error::CertificateName { name: name.0.to_string() }),
        };
        let scope = scope.parse().map_err(|_| Error::CertificateName { name: parts.join(":") })?;
        Ok(Self::new(format!("{name}/certificate"), scope, experiments, Account::default()))
    }

    /// The caller of a request that the guard has let in.
    ///
    /// # Errors
    /// [`Error::TokenMissing`]: it did not come past the guard.
    pub(crate) fn of(extensions: &Extensions) -> Result<Self, Error> {
        extensions.get().cloned().ok_or(Error::TokenMissing)
    }

    /// The same caller with no more than this scope.
    pub(crate) fn at_most(&self, most: Scope) -> Self {
        let Known { actor, scope, experiments, account } = &*self.0;
        Self::new(actor.clone(), (*scope).min(most), experiments.clone(), account.clone())
    }

    /// What is kept of it with a ticket.
    pub(crate) fn to_ticket(&self, until_us: i64) -> TicketRow {
        let Known { actor, scope, experiments, account: Account { token_id, share } } = &*self.0;
        TicketRow {
            actor: actor.clone(),
            scope: scope.name().to_owned(),
            experiments: experiments.clone(),
            token_id: token_id.to_string(),
            compute_share: *share,
            until_us,
        }
    }

    /// The caller that a ticket was given to.
    pub(crate) fn of_ticket(row: &TicketRow) -> Option<Self> {
        let TicketRow { actor, scope, experiments, token_id, compute_share, until_us: _ } = row;
        let account = Account { token_id: token_id.as_str().into(), share: *compute_share };
        Some(Self::new(actor.clone(), scope.parse().ok()?, experiments.clone(), account))
    }

    /// What the log of events calls it.
    pub fn actor(&self) -> &str {
        &self.0.actor
    }

    /// What it may do.
    pub fn scope(&self) -> Scope {
        self.0.scope
    }

    /// On whose account it computes.
    pub(crate) fn account(&self) -> &Account {
        &self.0.account
    }

    /// The token that new sessions are counted for.
    pub(crate) fn owner(&self) -> Option<String> {
        let id = &self.0.account.token_id;
        (!id.is_empty()).then(|| id.to_string())
    }

    /// The beginning that the names of its experiments have; nothing where it may see all.
    pub(crate) fn experiments(&self) -> Option<&str> {
        self.0.experiments.as_deref()
    }

    /// Whether sessions of this experiment are there for it.
    pub(crate) fn sees(&self, experiment: &str) -> bool {
        self.experiments().is_none_or(|prefix| experiment.starts_with(prefix))
    }

    /// # Errors
    /// [`Error::ScopeDenied`]: it may not do what needs this scope.
    pub(crate) fn check(&self, needed: Scope) -> Result<(), Error> {
        if self.scope() >= needed {
            return Ok(());
        }
        Err(Error::ScopeDenied { needed: needed.name(), has: self.scope().name() })
    }

    /// # Errors
    /// [`Error::ScopeDenied`]: it may not do what is about the server as a whole.
    pub(crate) fn check_whole_server(&self, needed: Scope) -> Result<(), Error> {
        self.check(needed)?;
        match self.experiments() {
            None => Ok(()),
            Some(prefix) => Err(Error::ExperimentDenied { prefix: prefix.to_owned() }),
        }
    }

    /// # Errors
    /// [`Error::ExperimentDenied`]: it may not put sessions into this experiment.
    pub(crate) fn check_experiment(&self, experiment: &str) -> Result<(), Error> {
        match self.experiments() {
            Some(prefix) if !experiment.starts_with(prefix) => {
                Err(Error::ExperimentDenied { prefix: prefix.to_owned() })
            }
            _ => Ok(()),
        }
    }
}

/// Whoever calls, as far as only the connection knows.
pub(crate) fn unidentified(extensions: &Extensions) -> Caller {
    Caller::anyone(peer::address(extensions))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Result<Caller, Error> {
        Caller::by_certificate(&CertificateName(name.into()))
    }

    #[test]
    fn a_certificate_says_what_its_holder_may_do() {
        let arm = named("robot:arm-1").unwrap();
        assert_eq!((arm.actor(), arm.scope(), arm.experiments()), ("arm-1/certificate", Scope::Robot, None));
        let wall = named("read:wall:mugs:").unwrap();
        assert_eq!((wall.scope(), wall.experiments()), (Scope::Read, Some("mugs:")));
        for other in ["arm-1", "root:arm-1", "robot:", "", ":arm-1"] {
            assert_eq!(named(other).unwrap_err().reason(), "CERTIFICATE_NAME", "{other}");
        }
    }

    #[test]
    fn a_caller_who_is_kept_to_experiments_sees_and_makes_no_others() {
        let wall = named("operate:wall:mugs").unwrap();
        assert!(wall.sees("mugs") && wall.sees("mugs-2") && !wall.sees("cups") && !wall.sees(""));
        assert!(wall.check_experiment("mugs").is_ok());
        assert_eq!(wall.check_experiment("").unwrap_err().reason(), "SCOPE_DENIED");
        assert_eq!(wall.check_whole_server(Scope::Read).unwrap_err().reason(), "SCOPE_DENIED");
        assert!(Caller::anyone(None).sees("anything"));
    }

    #[test]
    fn a_ticket_never_adds_to_a_scope() {
        let robot = named("robot:arm").unwrap();
        assert_eq!(robot.at_most(Scope::Read).scope(), Scope::Read);
        assert_eq!(robot.at_most(Scope::Admin).scope(), Scope::Robot);
    }
}
