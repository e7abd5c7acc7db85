"""What is sent again, against a server that says what a test wants, over a real connection."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent import futures
from typing import Any

import grpc
import pytest
from google.protobuf.any_pb2 import Any as AnyMessage
from google.protobuf.message import Message

import palpate
from palpate import status_details_pb2 as details
from palpate import v1
from palpate.errors import HINTS


class Scripted(grpc.GenericRpcHandler):
    """Answers every call with the next step of its script, and with success when that is over."""

    def __init__(self) -> None:
        self.script: list[tuple[grpc.StatusCode, str, list[Message]]] = []
        self.requests: list[tuple[str, bytes]] = []
        self.metadata: list[dict[str, str | bytes]] = []

    def service(self, call: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler[Any, Any]:
        def answer(request: bytes, context: grpc.ServicerContext) -> bytes:
            self.requests.append((call.method, request))
            self.metadata.append({key: value for key, value in context.invocation_metadata()})
            if call.method.endswith("GetServerInfo") or not self.script:
                return v1.Session(session_id="s", revision=1).SerializeToString()
            code, reason, more = self.script.pop(0)
            status = details.Status(code=code.value[0], message="no")
            for detail in [details.ErrorInfo(reason=reason), *more] if reason else more:
                kind = f"type.googleapis.com/google.rpc.{detail.DESCRIPTOR.name}"
                status.details.append(AnyMessage(type_url=kind, value=detail.SerializeToString()))
            if reason:
                context.set_trailing_metadata((("grpc-status-details-bin", status.SerializeToString()),))
            context.abort(code, "no")

        return grpc.unary_unary_rpc_method_handler(answer)


@pytest.fixture
def scripted() -> Iterator[tuple[Scripted, palpate.Client]]:
    scripted = Scripted()
    server = grpc.server(futures.ThreadPoolExecutor(2))
    server.add_generic_rpc_handlers((scripted,))
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    with palpate.Client(f"http://127.0.0.1:{port}", timeout=4) as client:
        yield scripted, client
    server.stop(None)


def wait(milliseconds: int) -> details.RetryInfo:
    info = details.RetryInfo()
    info.retry_delay.FromMilliseconds(milliseconds)
    return info


PASSES: list[tuple[grpc.StatusCode, str, list[Message]]] = [
    (grpc.StatusCode.UNAVAILABLE, "DRAINING", []),
    (grpc.StatusCode.UNAVAILABLE, "", []),
    (grpc.StatusCode.UNAVAILABLE, "STORE_DOWN", []),
    (grpc.StatusCode.DEADLINE_EXCEEDED, "DEADLINE_EXCEEDED", []),
    (grpc.StatusCode.RESOURCE_EXHAUSTED, "QUEUE_FULL", [wait(20)]),
    (grpc.StatusCode.CANCELLED, "", []),
]
STANDS: list[tuple[grpc.StatusCode, str, list[Message]]] = [
    (grpc.StatusCode.INVALID_ARGUMENT, "FIELD_INVALID", []),
    (grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND", []),
    (grpc.StatusCode.ALREADY_EXISTS, "REQUEST_ID_REUSED", []),
    (grpc.StatusCode.ABORTED, "REVISION_MISMATCH", []),
    (grpc.StatusCode.ABORTED, "ETAG_MISMATCH", []),
    (grpc.StatusCode.FAILED_PRECONDITION, "SESSION_FINISHED", []),
    (grpc.StatusCode.RESOURCE_EXHAUSTED, "TOO_LARGE", []),
    (grpc.StatusCode.RESOURCE_EXHAUSTED, "QUEUE_FULL", [wait(60_000)]),
    (grpc.StatusCode.INTERNAL, "INTERNAL", []),
    (grpc.StatusCode.PERMISSION_DENIED, "HOST_REFUSED", []),
]


@pytest.mark.parametrize("step", PASSES, ids=lambda step: step[1] or step[0].name)
def test_what_may_pass_is_sent_again_and_is_the_same(
    step: tuple[grpc.StatusCode, str, list[Message]], scripted: tuple[Scripted, palpate.Client]
) -> None:
    server, client = scripted
    server.script = [step, step]
    client.create_session("s")
    sent = [request for method, request in server.requests if method.endswith("CreateSession")]
    assert len(sent) == 3
    assert len(set(sent)) == 1
    assert v1.CreateSessionRequest.FromString(sent[0]).request_id


@pytest.mark.parametrize("step", STANDS, ids=lambda step: f"{step[1]}{len(step[2])}")
def test_what_stands_is_not_sent_again(
    step: tuple[grpc.StatusCode, str, list[Message]], scripted: tuple[Scripted, palpate.Client]
) -> None:
    server, client = scripted
    server.script = [step]
    with pytest.raises(palpate.Refused) as refused:
        client.create_session("s")
    assert len([method for method, _ in server.requests if method.endswith("CreateSession")]) == 1
    assert (refused.value.code, refused.value.reason) == (step[0], step[1])
    assert refused.value.hint == HINTS[step[1]]


def test_a_refusal_has_its_fields_and_its_wait(scripted: tuple[Scripted, palpate.Client]) -> None:
    server, client = scripted
    bad = details.BadRequest()
    bad.field_violations.add(field="prior.points", description="is empty")
    server.script = [(grpc.StatusCode.INVALID_ARGUMENT, "FIELD_INVALID", [bad, wait(1500)])]
    with pytest.raises(palpate.Refused, match="prior.points: is empty") as refused:
        client.create_session("s")
    assert refused.value.fields == {"prior.points": "is empty"}
    assert refused.value.retry_after == 1.5


def test_two_calls_have_two_request_ids_and_a_given_one_is_kept(scripted: tuple[Scripted, palpate.Client]) -> None:
    server, client = scripted
    for request_id in (None, None, "mine"):
        client.create_session("s", request_id=request_id)
    sent = [
        v1.CreateSessionRequest.FromString(body).request_id for method, body in server.requests if "Create" in method
    ]
    assert len(set(sent)) == 3
    assert sent[2] == "mine"
    assert server.requests[0][0].endswith("GetServerInfo")


def test_a_deletion_whose_reply_was_lost_is_done(scripted: tuple[Scripted, palpate.Client]) -> None:
    server, client = scripted
    session = client.create_session("s")
    gone: tuple[grpc.StatusCode, str, list[Message]] = (grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND", [])
    server.script = [(grpc.StatusCode.UNAVAILABLE, "", []), gone]
    session.delete()
    server.script = [gone]
    with pytest.raises(palpate.Refused):
        session.delete()


def test_a_call_names_its_session_and_what_was_seen_of_it(scripted: tuple[Scripted, palpate.Client]) -> None:
    server, client = scripted
    session = client.session("s")
    session.update(display_name="a mug")
    named = [(said.get("x-session-id"), said.get("x-min-revision")) for said in server.metadata]
    assert named == [(None, None), ("s", None), ("s", "1")], "what the server is, the session, and its new name"


def test_an_id_that_no_header_can_have_is_left_to_the_server(scripted: tuple[Scripted, palpate.Client]) -> None:
    server, client = scripted
    client.session("a mug\n\u00e4")
    assert "x-session-id" not in server.metadata[-1]
