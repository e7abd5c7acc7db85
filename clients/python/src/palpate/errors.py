"""What can go wrong with a call, as exceptions that say what to do."""

from __future__ import annotations

from typing import Any

import grpc

from palpate import status_details_pb2 as details

#: What to do about a refusal, by its reason; clients/README.md has the whole table.
HINTS = {
    "FIELD_INVALID": "correct the fields that are named; nothing was changed",
    "NON_FINITE": "send finite numbers; nothing was changed",
    "SESSION_NOT_FOUND": "create the session, or look for its id in the list of sessions",
    "SESSION_EXISTS": "open it by its id, or choose another id",
    "REQUEST_ID_REUSED": "give each logical call a request_id of its own",
    "REVISION_MISMATCH": "somebody else changed the session: read it again and decide",
    "ETAG_MISMATCH": "somebody else changed the session: read it again and decide",
    "ETAG_MISSING": "read the session, and send its etag along",
    "NO_VISUAL_PRIOR": "add a view first",
    "NO_REFERENCE": "send the true surface along, or keep it with the session",
    "SESSION_FINISHED": "fork the session, or create a new one",
    "SESSION_FULL": "go on in a new session, and end earlier, when should_stop says why",
    "SESSION_QUARANTINED": "restore a copy of the database, or go on in a new session",
    "QUOTA": "end what is not needed, such as open streams, and send the same call again",
    "QUEUE_FULL": "wait as long as the server says, and send the same call again",
    "OVERLOADED": "wait as long as the server says, and send the same call again",
    "TOO_LARGE": "send less: the message says which limit there is",
    "HEADER_TOO_LARGE": "send fewer or shorter headers",
    "STORE_FULL": "make room on the server's disk, and send the same call again",
    "STORE_DOWN": "look after the server's disk, and send the same call again",
    "DRAINING": "the server is stopping: send the same call again when it is back",
    "DEADLINE_EXCEEDED": "send the same call again, with more time",
    "BODY_TIMEOUT": "send the same call again, over a faster connection",
    "TOKEN_MISSING": "call with a token that `palpate token create` made on the server",
    "TOKEN_INVALID": "look at the token: it is mistyped, of another server, or was revoked",
    "TOKEN_EXPIRED": "ask who runs the server for a new token",
    "CERTIFICATE_NAME": "call with a certificate whose common name is SCOPE:NAME",
    "SCOPE_DENIED": "use a token that was made for this",
    "HOST_MISSING": "send one Host header",
    "HOST_REFUSED": "call the server as localhost, or start it with --allow-host",
    "ORIGIN_REFUSED": "start the server with --allow-origin",
    "INTERNAL": "report it, with the server's log",
}

#: Codes of refusals after which the same call may succeed without any change. CANCELLED is none of the caller's doing
#: where the caller still waits.
_MAY_PASS = {grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.CANCELLED}
#: Codes that the connection itself gives where no answer came.
_NO_ANSWER = _MAY_PASS | {grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN}


class EvidenceWarning(UserWarning):
    """The server took what was sent and doubts it: a force of the wrong sign, points of the table, an early contact.

    `code` is its kind, for instance `WARNING_CODE_EARLY_CONTACT`, and `parameters` its numbers by name.
    docs/robots.md says what to do about each kind.
    """

    def __init__(
        self, message: str, code: str = "WARNING_CODE_UNSPECIFIED", parameters: dict[str, float] | None = None
    ):
        super().__init__(message)
        self.code = code
        self.parameters = parameters or {}


class PalpateError(Exception):
    """A call that did not succeed."""

    def is_transient(self) -> bool:
        """Whether the same call, with the same request_id, may succeed a little later."""
        return False


def _what_to_do(detail: str) -> str:
    """About a connection that was not made, by what gRPC says of it."""
    if "CERTIFICATE_VERIFY_FAILED" in detail:
        return "its certificate is not trusted: give the authority that it comes from as `ca=`"
    # By the age of grpcio: what a port that speaks TLS, or no gRPC at all, makes of a call in the clear.
    if "SETTINGS frame" in detail or "http1.x server" in detail:
        return "it speaks no gRPC in the clear: write https:// if it speaks TLS, or check the port"
    return "is one running there? `palpate serve` starts one"


class NoServer(PalpateError):
    """Nobody answers at the address."""

    def __init__(self, url: str, detail: str):
        super().__init__(f"no server answers at {url} ({detail}); {_what_to_do(detail)}")
        self.url = url

    def is_transient(self) -> bool:
        return True


class NoAnswer(PalpateError):
    """The connection broke, or the time was over, in every attempt.

    Whether the server acted on the call is not known; the same call with the same request_id is safe.
    """

    def __init__(self, detail: str, attempts: int):
        super().__init__(f"the server did not answer in {attempts} attempt{'' if attempts == 1 else 's'}: {detail}")
        self.detail = detail
        self.attempts = attempts

    def is_transient(self) -> bool:
        return True


class Refused(PalpateError):
    """The server said no; nothing was changed.

    Attributes:
        code: the gRPC status code.
        reason: why, for programs: for instance SESSION_NOT_FOUND; "" where the server gave none.
        message: what is wrong, for people.
        fields: what is wrong with each field of the request, by its path.
        hint: what to do.
        retry_after: seconds to wait before the next attempt, if the server said so.
        attempts: how often the call was tried.
    """

    def __init__(
        self,
        code: grpc.StatusCode,
        reason: str,
        message: str,
        fields: dict[str, str] | None = None,
        retry_after: float | None = None,
        attempts: int = 1,
    ):
        self.code = code
        self.reason = reason
        self.message = message
        self.fields = fields or {}
        self.hint = HINTS.get(reason, "")
        self.retry_after = retry_after
        self.attempts = attempts
        unsaid = [f"; {field}: {why}" for field, why in self.fields.items() if why not in message]
        tries = f", after {attempts} attempts" if attempts > 1 else ""
        hint = f"; {self.hint}" if self.hint else ""
        super().__init__(f"{message}{''.join(unsaid)} ({reason or code.name}{tries}{hint})")

    def is_transient(self) -> bool:
        if self.code is grpc.StatusCode.RESOURCE_EXHAUSTED:
            # Without a time to wait it is a limit that waiting does not lift, such as a size.
            return self.retry_after is not None
        if self.code is grpc.StatusCode.ABORTED:
            # Somebody else changed the session: only the caller knows whether the call still makes sense.
            return self.reason not in ("REVISION_MISMATCH", "ETAG_MISMATCH")
        return self.code in _MAY_PASS


class Unauthenticated(Refused):
    """The server asks who calls, and the token or certificate does not say it."""


class PermissionDenied(Refused):
    """The server knows who calls, and that they may not do this."""


#: Refusals that are a class of their own.
_KINDS = {
    grpc.StatusCode.UNAUTHENTICATED: Unauthenticated,
    grpc.StatusCode.PERMISSION_DENIED: PermissionDenied,
}


def from_rpc_error(error: grpc.RpcError, attempts: int) -> NoAnswer | Refused:
    """The exception for what gRPC raised in the last of `attempts` attempts."""
    call: Any = error  # what a call raises is a call, too, which the types of grpcio do not say
    code, message = call.code(), call.details() or ""
    # Pairs in both clients; the asyncio one's metadata is a mapping besides, of which old versions make no dict.
    metadata = {key: value for key, value in call.trailing_metadata() or ()}
    status = details.Status.FromString(bytes(metadata.get("grpc-status-details-bin", b"")))
    info, bad, retry = details.ErrorInfo(), details.BadRequest(), details.RetryInfo()
    for detail in status.details:
        for kind in (info, bad, retry):
            if detail.type_url == f"type.googleapis.com/google.rpc.{kind.DESCRIPTOR.name}":
                kind.ParseFromString(detail.value)
    if not info.reason and code in _NO_ANSWER:
        return NoAnswer(message, attempts)
    fields = {violation.field: violation.description for violation in bad.field_violations}
    after = retry.retry_delay.ToTimedelta().total_seconds() if retry.HasField("retry_delay") else None
    return _KINDS.get(code, Refused)(code, info.reason, message, fields, after, attempts)


def is_gone_after_retry(error: Refused) -> bool:
    """Whether a retry found no session: then an attempt before it, whose reply was lost, removed it."""
    return error.reason == "SESSION_NOT_FOUND" and error.attempts > 1
