//! A plain HTTP client: requests as anybody would send them, messages by the contract's own JSON mapping.

use std::sync::LazyLock;

use prost::{Message, Name};
use prost_reflect::{DescriptorPool, DynamicMessage, MessageDescriptor, SerializeOptions};
use reqwest::{Method, RequestBuilder, Response};
use serde_json::Value;

use super::{Outcome, Refused, soon};

static CONTRACT: LazyLock<DescriptorPool> =
    LazyLock::new(|| DescriptorPool::decode(palpate_proto::FILE_DESCRIPTOR_SET).unwrap());

/// A caller of one server.
#[derive(Clone, Debug)]
pub(crate) struct Http {
    client: reqwest::Client,
    url: String,
    token: Option<String>,
}

impl Http {
    pub(super) fn new(url: String) -> Self {
        // Which cryptography it uses is the program's choice; another test may have made it already.
        let _ = rustls::crypto::ring::default_provider().install_default();
        Self { client: reqwest::Client::new(), url, token: None }
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.client.request(method, format!("{}{path}", self.url));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    /// The same caller, who shows this token.
    pub(crate) fn with_token(&self, token: &str) -> Self {
        Self { token: Some(token.to_owned()), ..self.clone() }
    }

    pub(crate) fn get(&self, path: &str) -> RequestBuilder {
        self.request(Method::GET, path)
    }

    /// A request with a JSON body.
    pub(crate) fn post(&self, path: &str, body: &Value) -> RequestBuilder {
        self.request(Method::POST, path).json(body)
    }

    /// Follows a session's events.
    pub(crate) async fn events(&self, session_id: &str, last_event_id: Option<i64>) -> EventStream {
        let request = self.get(&format!("/v1/sessions/{session_id}/events"));
        let mut request = request.header("accept", "text/event-stream");
        if let Some(id) = last_event_id {
            request = request.header("last-event-id", id);
        }
        EventStream::from(accepted(request).await.unwrap())
    }
}

/// Sends a request to a server that must answer, whatever it says.
pub(crate) async fn send(request: RequestBuilder) -> Response {
    soon("an answer", request.send()).await.unwrap()
}

/// A header that must be there.
pub(crate) fn header<'a>(response: &'a Response, name: &str) -> &'a str {
    let value = response.headers().get(name).unwrap_or_else(|| panic!("no {name}: {response:?}"));
    value.to_str().unwrap()
}

/// The answer, or why there is none.
pub(crate) async fn accepted(request: RequestBuilder) -> Outcome<Response> {
    let response = send(request).await;
    let status = response.status();
    if !status.is_client_error() && !status.is_server_error() {
        return Ok(response);
    }
    let content_type = header(&response, "content-type").to_owned();
    let body = response.text().await.unwrap();
    Err(Refused::from_problem(status.as_u16(), &content_type, &body))
}

/// The answer as a message of the contract.
pub(super) async fn answered<M: Message + Name + Default>(request: RequestBuilder) -> Outcome<M> {
    let response = accepted(request).await?;
    assert_eq!(header(&response, "content-type"), "application/json");
    Ok(from_json(&response.text().await.unwrap()))
}

/// Reads a message by the contract's JSON mapping.
pub(crate) fn from_json<M: Message + Name + Default>(text: &str) -> M {
    let mut json = serde_json::Deserializer::from_str(text);
    let message = DynamicMessage::deserialize(descriptor::<M>(), &mut json);
    message.unwrap_or_else(|error| panic!("{error} in {text}")).transcode_to().unwrap()
}

/// Writes a message by the contract's JSON mapping, as a client would that leaves out what is unset.
pub(crate) fn to_json<M: Message + Name>(message: &M) -> Value {
    let options = SerializeOptions::new().use_proto_field_name(true);
    let message = DynamicMessage::decode(descriptor::<M>(), message.encode_to_vec().as_slice()).unwrap();
    message.serialize_with_options(serde_json::value::Serializer, &options).unwrap()
}

fn descriptor<M: Name>() -> MessageDescriptor {
    CONTRACT.get_message_by_name(&M::full_name()).unwrap()
}

/// An open stream of server-sent events.
#[derive(Debug)]
pub(crate) struct EventStream {
    response: Response,
    buffer: String,
}

/// One server-sent event.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct SseEvent {
    pub(crate) id: Option<i64>,
    pub(crate) name: String,
    pub(crate) data: String,
}

impl From<Response> for EventStream {
    fn from(response: Response) -> Self {
        assert_eq!(header(&response, "content-type"), "text/event-stream");
        Self { response, buffer: String::new() }
    }
}

impl EventStream {
    /// Reads until the stream ends, well or not.
    pub(crate) async fn ended(&mut self) {
        while let Ok(Some(_)) = self.response.chunk().await {}
    }

    /// The next event, comments left out; `None` at the end of the stream.
    pub(crate) async fn next(&mut self) -> Option<SseEvent> {
        loop {
            while let Some((block, rest)) = self.buffer.split_once("\n\n") {
                let event = parse(block);
                self.buffer = rest.to_owned();
                if event.is_some() {
                    return event;
                }
            }
            let chunk = soon("a server-sent event", self.response.chunk()).await.unwrap()?;
            self.buffer.push_str(std::str::from_utf8(&chunk).unwrap());
        }
    }
}

/// `None` for a block that is nothing but comments.
fn parse(block: &str) -> Option<SseEvent> {
    let mut event = SseEvent::default();
    for line in block.lines().filter(|line| !line.starts_with(':')) {
        let (field, value) = line.split_once(':').unwrap();
        let value = value.strip_prefix(' ').unwrap_or(value);
        match field {
            "id" => event.id = Some(value.parse().unwrap()),
            "event" => event.name = value.to_owned(),
            "data" => event.data.push_str(value),
            other => panic!("no server-sent event has a field {other}"),
        }
    }
    (event != SseEvent::default()).then_some(event)
}
