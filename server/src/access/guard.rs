//! The guard before all calls: finds out who calls, or refuses, before anything of the body is read.
//!
//! A token comes as `Authorization: Bearer ...`, over gRPC and HTTP alike; a certificate with the connection; a ticket
//! in the query of a `GET`. What a caller then may do is not decided here but where calls are answered.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes};
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::Response;
use http::header::{AUTHORIZATION, CONTENT_TYPE, WWW_AUTHENTICATE};
use http::request::Parts;
use http::{HeaderMap, HeaderValue, Method, Uri};
use hyper::body::{Body as HttpBody, Frame, SizeHint};
use tokio::time::Instant;
use tonic::Code;

use super::attempts::Attempts;
use super::caller::{Caller, CertificateName, unidentified};
use super::registry::Registry;
use super::scope::Scope;
use super::tickets::Tickets;
use crate::error::Error;
use crate::limits::Limits;
use crate::metrics::Metrics;
use crate::serve::bodies;
use crate::store::Store;
use crate::{grpc, http as web, peer};

const TICKET: &str = "ticket=";
/// How health checks over gRPC begin: whoever balances loads has no token.
const HEALTH: &str = "/grpc.health.v1.Health/";
/// What a caller over HTTP is told to send.
const CHALLENGE: HeaderValue = HeaderValue::from_static("Bearer realm=\"palpate\"");

/// Who is let in; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Guard(Arc<Rules>);

#[derive(Debug)]
struct Rules {
    /// Nothing where whoever reaches the server may call.
    registry: Option<Registry>,
    tickets: Tickets,
    attempts: Attempts,
    metrics: Metrics,
}

/// A caller who was let in, and the token that it has to go on having while it is answered.
struct Admitted {
    caller: Caller,
    token_id: Option<String>,
}

impl Guard {
    /// Lets in who has a token of this registry, or a certificate; all, where there is none.
    pub(crate) fn new(registry: Option<Registry>, store: &Store, limits: &Limits) -> Self {
        let attempts = Attempts::new(limits.refused_wait);
        let tickets = Tickets::new(store.ticket_table());
        Self(Arc::new(Rules { registry, tickets, attempts, metrics: store.metrics.clone() }))
    }

    /// A ticket in place of this caller's token.
    ///
    /// # Errors
    /// Too many are out.
    pub(crate) async fn ticket(&self, caller: &Caller) -> Result<String, Error> {
        self.0.tickets.issue(caller).await
    }

    /// Around the routes: answers, or refuses.
    pub(crate) async fn admit(State(guard): State<Self>, request: Request, next: Next) -> Response {
        let (mut parts, body) = request.into_parts();
        let ticket = take_ticket(&mut parts);
        if parts.uri.path().starts_with(HEALTH) {
            return next.run(Request::from_parts(parts, body)).await;
        }
        match guard.0.identify(&parts, ticket.as_deref()).await {
            Ok(Admitted { caller, token_id }) => {
                parts.extensions.insert(caller);
                let response = next.run(Request::from_parts(parts, body)).await;
                match (token_id, &guard.0.registry) {
                    (Some(id), Some(registry)) => while_in_force(response, registry.clone(), id),
                    _ => response,
                }
            }
            Err(error) => {
                let address = peer::address(&parts.extensions);
                guard.0.metrics.unknown_caller(&error);
                let wait = guard.0.attempts.failed(address, Instant::now());
                tracing::info!(
                    method = %parts.method, path = parts.uri.path(), ?address, reason = error.reason(),
                    "a caller is not known"
                );
                tokio::time::sleep(wait).await;
                bodies::unread(&parts, refusal(&parts.headers, &error))
            }
        }
    }
}

impl Rules {
    async fn identify(&self, parts: &Parts, ticket: Option<&str>) -> Result<Admitted, Error> {
        let free = |caller| Admitted { caller, token_id: None };
        let Some(registry) = &self.registry else { return Ok(free(unidentified(&parts.extensions))) };
        if let Some(token) = bearer(&parts.headers)? {
            let caller = registry.caller(token).await?;
            return Ok(Admitted { token_id: caller.owner(), caller });
        }
        if let Some(ticket) = ticket.filter(|_| parts.method == Method::GET) {
            let caller = self.tickets.redeem(ticket).await?;
            return Ok(Admitted { token_id: caller.owner(), caller });
        }
        match parts.extensions.get::<CertificateName>() {
            Some(name) => Caller::by_certificate(name).map(free),
            None => Err(Error::TokenMissing),
        }
    }
}

/// The token of a request, if it has one.
fn bearer(headers: &HeaderMap) -> Result<Option<&str>, Error> {
    let Some(value) = headers.get(AUTHORIZATION) else { return Ok(None) };
    let value = value.to_str().map_err(|_| Error::TokenInvalid)?;
    let (scheme, token) = value.split_once(' ').ok_or(Error::TokenInvalid)?;
    if scheme.eq_ignore_ascii_case("bearer") { Ok(Some(token.trim())) } else { Err(Error::TokenInvalid) }
}

/// The ticket of a request's query, which nobody after this sees.
fn take_ticket(parts: &mut Parts) -> Option<String> {
    let query = parts.uri.query()?;
    let ticket = query.split('&').find_map(|pair| pair.strip_prefix(TICKET))?.to_owned();
    let others: Vec<&str> = query.split('&').filter(|pair| !pair.starts_with(TICKET)).collect();
    let target = if others.is_empty() {
        parts.uri.path().to_owned()
    } else {
        format!("{}?{}", parts.uri.path(), others.join("&"))
    };
    let mut uri = parts.uri.clone().into_parts();
    uri.path_and_query = Some(target.parse().ok()?);
    parts.uri = Uri::from_parts(uri).ok()?;
    Some(ticket)
}

/// A refusal in the form that the caller reads.
pub(crate) fn refusal(headers: &HeaderMap, error: &Error) -> Response {
    let content_type =
        headers.get(CONTENT_TYPE).filter(|value| value.as_bytes().starts_with(b"application/grpc"));
    match content_type {
        Some(content_type) => grpc::refusal(error, content_type),
        None => {
            let mut response = web::refusal(error);
            if error.grpc_code() == Code::Unauthenticated {
                response.headers_mut().insert(WWW_AUTHENTICATE, CHALLENGE);
            }
            response
        }
    }
}

/// Around routes of the program: only callers of this scope, who are kept to no experiments.
pub async fn require(State(needed): State<Scope>, request: Request, next: Next) -> Response {
    let checked = Caller::of(request.extensions()).and_then(|caller| caller.check_whole_server(needed));
    match checked {
        Ok(()) => next.run(request).await,
        Err(error) => refusal(request.headers(), &error),
    }
}

/// The response, which ends early where the token that it is given for does.
fn while_in_force(response: Response, registry: Registry, token_id: String) -> Response {
    let content_type = response.headers().get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    // Over gRPC-Web the trailers are a part of the data, which somebody else writes.
    let has_trailers = matches!(content_type, Some(b"application/grpc" | b"application/grpc+proto"));
    response.map(|body| {
        if body.is_end_stream() {
            return body;
        }
        let ended = Box::pin(async move { registry.ended(&token_id).await });
        Body::new(WhileInForce { body, ended, has_trailers, is_over: false })
    })
}

struct WhileInForce {
    body: Body,
    ended: Pin<Box<dyn Future<Output = Error> + Send>>,
    has_trailers: bool,
    is_over: bool,
}

impl HttpBody for WhileInForce {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = self.get_mut();
        if this.is_over {
            return Poll::Ready(None);
        }
        let Poll::Ready(error) = this.ended.as_mut().poll(context) else {
            return Pin::new(&mut this.body).poll_frame(context);
        };
        this.is_over = true;
        this.body = Body::empty();
        if !this.has_trailers {
            return Poll::Ready(Some(Err(axum::Error::new(error))));
        }
        let refusal = grpc::refusal(&error, &HeaderValue::from_static("application/grpc"));
        let mut trailers = refusal.into_parts().0.headers;
        trailers.remove(CONTENT_TYPE);
        Poll::Ready(Some(Ok(Frame::trailers(trailers))))
    }

    fn is_end_stream(&self) -> bool {
        self.is_over || self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(uri: &str) -> Parts {
        http::Request::get(uri).body(()).unwrap().into_parts().0
    }

    #[test]
    fn a_ticket_is_taken_out_of_the_query_and_nothing_else() {
        for (uri, ticket, left) in [
            ("/v1/sessions/a/events?ticket=abc", Some("abc"), "/v1/sessions/a/events"),
            ("/e?after_revision=1&ticket=abc&x=%20", Some("abc"), "/e?after_revision=1&x=%20"),
            ("/e?tickets=abc", None, "/e?tickets=abc"),
            ("/e", None, "/e"),
        ] {
            let mut parts = parts(uri);
            assert_eq!(take_ticket(&mut parts).as_deref(), ticket);
            assert_eq!(parts.uri, left);
        }
    }

    #[test]
    fn only_a_bearer_token_is_one() {
        let of = |value: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(AUTHORIZATION, HeaderValue::from_static(value));
            bearer(&headers).map(|token| token.map(str::to_owned))
        };
        assert_eq!(bearer(&HeaderMap::new()), Ok(None));
        assert_eq!(of("bearer  abc"), Ok(Some("abc".to_owned())));
        for other in ["Basic abc", "abc", ""] {
            assert_eq!(of(other), Err(Error::TokenInvalid), "{other}");
        }
    }
}
