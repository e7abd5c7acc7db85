"""A collector of OpenTelemetry that prints each span with the one above it; its port goes into the file given."""

import sys
from concurrent import futures
from pathlib import Path

import grpc
from opentelemetry.proto.collector.trace.v1 import trace_service_pb2, trace_service_pb2_grpc

spans = {}


def title(span) -> str:
    """What a span is about: a call is told by its method, a stage by its work."""
    attributes = {attribute.key: attribute.value.string_value for attribute in span.attributes}
    return " ".join([span.name, attributes.get("method", attributes.get("work", "-"))])


class Collector(trace_service_pb2_grpc.TraceServiceServicer):
    """Takes what is sent."""

    def Export(self, request, context):  # noqa: N802, the name in the contract
        """Prints the spans; one whose parent is not there yet waits for it."""
        for resource_spans in request.resource_spans:
            for attribute in resource_spans.resource.attributes:
                if attribute.key == "service.name":
                    print("resource", attribute.value.string_value, flush=True)
            for scope in resource_spans.scope_spans:
                for span in scope.spans:
                    spans[span.span_id] = span
        for span in [span for span in spans.values() if span.parent_span_id in spans or not span.parent_span_id]:
            above = spans.get(span.parent_span_id)
            if span.span_id not in printed:
                printed.add(span.span_id)
                print(title(span), "below", title(above) if above else "nothing", flush=True)
        return trace_service_pb2.ExportTraceServiceResponse()


printed = set()
server = grpc.server(futures.ThreadPoolExecutor(max_workers=1))
trace_service_pb2_grpc.add_TraceServiceServicer_to_server(Collector(), server)
port = server.add_insecure_port("127.0.0.1:0")
server.start()
Path(sys.argv[1]).write_text(str(port))
server.wait_for_termination()
