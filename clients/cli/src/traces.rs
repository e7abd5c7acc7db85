//! Spans for OpenTelemetry: each call, and in it the wait for a thread, the computation and the commit.
//!
//! They go in batches to the collector that `OTEL_EXPORTER_OTLP_ENDPOINT` names, over gRPC; without it nothing is sent.
//! A collector that does not answer costs spans, and robots nothing.

use std::sync::OnceLock;

use opentelemetry::KeyValue;
use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::Subscriber;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::{EnvFilter, Layer};

use crate::failure::Failure;
use crate::version::VERSION;

/// Which spans are sent, whatever the log shows.
const SPANS: &str = "off,palpate_server=debug,palpate=info";

/// What sends the spans of this process.
static PROVIDER: OnceLock<SdkTracerProvider> = OnceLock::new();

/// What makes spans of the program's own; nothing where no collector is named. Needs the runtime that will send them.
///
/// # Errors
/// The environment names no usable collector.
pub(crate) fn layer<S>() -> Result<Option<impl Layer<S> + Send + Sync>, Failure>
where
    S: Subscriber + for<'span> LookupSpan<'span> + Send + Sync,
{
    let is_wanted = |name: &&str| std::env::var_os(name).is_some_and(|url| !url.is_empty());
    if !["OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"].iter().any(is_wanted) {
        return Ok(None);
    }
    let exporter = SpanExporter::builder().with_tonic().build()?;
    let resource = Resource::builder().with_attribute(KeyValue::new("service.version", VERSION.as_str()));
    // OTEL_SERVICE_NAME and OTEL_RESOURCE_ATTRIBUTES say otherwise where they are set.
    let resource = if std::env::var_os("OTEL_SERVICE_NAME").is_some() {
        resource
    } else {
        resource.with_service_name("palpate")
    };
    let provider =
        SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource.build()).build();
    let tracer = provider.tracer("palpate");
    // The log starts once.
    let _ = PROVIDER.set(provider);
    Ok(Some(tracing_opentelemetry::layer().with_tracer(tracer).with_filter(EnvFilter::try_new(SPANS)?)))
}

/// Sends what is left. The runtime still has to run.
pub(crate) fn finish() {
    if let Some(Err(error)) = PROVIDER.get().map(SdkTracerProvider::shutdown) {
        tracing::warn!(%error, "the last spans were not sent");
    }
}
