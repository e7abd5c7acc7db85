# Made by generate.py from aio/client.py: change that.
"""The connection to a server."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import grpc

from palpate import calls, v1
from palpate.access import Pem, access
from palpate.session import Session
from palpate.calls import Call
from palpate.channel import connect, target
from palpate.errors import NoAnswer, NoServer, PalpateError, from_rpc_error
from palpate.retry import Attempts, new_request_id
from palpate.streams import import_requests

T = TypeVar("T")


class Client:
    """A connection to a Palpate server.

    Every call is tried again while the server is away or busy, under one request_id, so that nothing is counted twice.
    A client may be used by several threads at once.

    It connects when it is entered as a context, or at the first call.

    Args:
        url: of the server.
        timeout: seconds that a call may take in all, with its retries.
        connect_timeout: seconds in which the server must answer for the first time.
        token: says who calls, where the server asks; by default PALPATE_TOKEN, or what is in PALPATE_TOKEN_FILE.
        ca: the authority that the server's certificate comes from, for https://; by default PALPATE_CA, or those that
            grpcio brings along. A path of a PEM file or its content, as the next two.
        certificate, key: what says who calls instead of a token; by default PALPATE_CERTIFICATE and PALPATE_KEY.

    Raises:
        ValueError: `url` is no address of a server, or something of the others cannot be used.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:7257",
        timeout: float = 60.0,
        connect_timeout: float = 5.0,
        *,
        token: str | None = None,
        ca: Pem | None = None,
        certificate: Pem | None = None,
        key: Pem | None = None,
    ):
        self.url = url
        self.timeout = timeout
        self._connect_timeout = connect_timeout
        self._target = target(url)
        self._access = access(url, token, ca, certificate, key)
        self._channel: grpc.Channel | None = None
        self._info: v1.ServerInfo | None = None

    def __enter__(self) -> Client:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def connect(self) -> v1.ServerInfo:
        """Connects, if that was not done yet; the server's versions, capabilities and limits.

        Raises:
            NoServer: nobody answers at the address.
        """
        if self._info is None:
            try:
                self._info = self._run(calls.server_info(), self._connect_timeout)
            except NoAnswer as error:
                raise NoServer(self.url, error.detail) from None
        return self._info

    def close(self) -> None:
        """Closes the connection; the sessions stay on the server."""
        if self._channel is not None:
            self._channel.close()
        self._channel, self._info = None, None

    def create_session(
        self,
        session_id: str = "",
        *,
        frame_id: str = "",
        display_name: str = "",
        experiment: str = "",
        labels: Mapping[str, str] | None = None,
        method: str | None = None,
        strategy: str | None = None,
        budget: int | None = None,
        table_z: float | None = None,
        sensors: Iterable[v1.Sensor] = (),
        shadow: Iterable[str] = (),
        config: v1.SessionConfig | Mapping[str, Any] | None = None,
        request_id: str | None = None,
    ) -> Session:
        """Creates a session, which then awaits its first view.

        Args:
            session_id: [a-z][a-z0-9-]{2,62}; by default the server makes one.
            frame_id: name of the frame that all points and poses are in, for instance "base".
            display_name, experiment, labels: for people, for tables and for filters.
            method: PALPATE, PAPER or GPIS; by default the first.
            strategy: PROACTIVE, MIN_UNCERTAINTY, UNIFORM, RANDOM or EXPECTED_GAIN.
            budget: attempts after which the server advises to stop.
            table_z: height in metres of the table that the object stands on; no approach enters it.
            sensors: the pads, each made by `palpate.sensor`.
            shadow: strategies whose choices are recorded beside the session's own.
            config: anything else, as a SessionConfig or a dictionary of its fields.
            request_id: makes a retry safe after this program was restarted; by default one is made.

        Raises:
            Refused: SESSION_EXISTS, or FIELD_INVALID with the fields named.
        """
        request = v1.CreateSessionRequest(
            session_id=session_id,
            frame_id=frame_id,
            display_name=display_name,
            experiment=experiment,
            labels=labels or {},
            config=calls.session_config(config, method, strategy, budget, table_z, sensors, shadow),
            request_id=request_id or "",
        )
        return Session(self, self.run(calls.create_session(request)))

    def session(self, session_id: str) -> Session:
        """Opens a session that is there.

        Raises:
            Refused: SESSION_NOT_FOUND.
        """
        return Session(self, self.run(calls.get_session(session_id)))

    def sessions(
        self, *, experiment: str = "", labels: Mapping[str, str] | None = None, state: str | None = None
    ) -> Iterator[Session]:
        """The server's sessions, newest first: of one experiment, with these labels, in this state, if said."""
        token = ""
        while True:
            page = self.run(calls.list_sessions(token, experiment, labels, state))
            for info in page.sessions:
                yield Session(self, info)
            token = page.next_page_token
            if not token:
                return

    def experiments(self) -> Iterator[v1.Experiment]:
        """The names that sessions are grouped by, with their numbers."""
        token = ""
        while True:
            page = self.run(calls.list_experiments(token))
            for experiment in page.experiments:
                yield experiment
            token = page.next_page_token
            if not token:
                return

    def experiment(
        self, name: str, by: Sequence[str] = (), labels: Mapping[str, str] | None = None
    ) -> v1.ExperimentSummary:
        """Mean and spread of the groups of an experiment.

        Args:
            by: what makes a group, for instance ["method", "labels.object"].
            labels: only sessions with these.
        """
        return self.run(calls.summarize_experiment(name, by, labels))

    def import_session(self, path: str | Path, session_id: str = "", *, experiment: str = "") -> Session:
        """Brings a session from a bundle, which `Session.export` wrote.

        Without an id and an experiment it is the same session, byte for byte; with one it is a fork of it.

        Raises:
            Refused: SESSION_EXISTS, or FIELD_INVALID for a file that is no bundle.
        """
        header = v1.CreateSessionRequest(session_id=session_id, experiment=experiment, request_id=new_request_id())
        self.connect()

        def attempt(left: float) -> Any:
            channel = self._open()
            method = channel.stream_unary(
                "/palpate.v1.SessionService/ImportSession",
                request_serializer=v1.ImportSessionRequest.SerializeToString,
                response_deserializer=v1.Session.FromString,
            )
            return method(import_requests(Path(path), header), timeout=left, metadata=self._access.metadata)

        info = self._again(attempt, self.timeout)
        return Session(self, info)

    # How the calls are carried out, for `Session`.

    def run(self, call: Call[T]) -> T:
        """Carries out `call`, again and again while it may succeed and there is time."""
        self.connect()
        return self._run(call, self.timeout)

    def stream(self, call: Call[T]) -> Iterator[T]:
        """The replies to `call`, as they come; it is not sent again.

        Raises:
            PalpateError: at the reply that did not come.
        """
        self.connect()
        channel = self._open()
        method = channel.unary_stream(
            call.path,
            request_serializer=type(call.request).SerializeToString,
            response_deserializer=call.reply.FromString,
        )
        replies = method(call.request, metadata=(*self._access.metadata, *call.metadata()))
        try:
            for reply in replies:
                yield call.read(reply)
        except grpc.RpcError as error:
            raise self._failure(error, 1) from None
        finally:
            replies.cancel()

    def _run(self, call: Call[T], timeout: float) -> T:
        def attempt(left: float) -> Any:
            # Held until the answer is there: a channel that nobody holds ends its calls.
            channel = self._open()
            method = channel.unary_unary(
                call.path,
                request_serializer=type(call.request).SerializeToString,
                response_deserializer=call.reply.FromString,
            )
            return method(call.request, timeout=left, metadata=(*self._access.metadata, *call.metadata()))

        return call.read(self._again(attempt, timeout))

    def _again(self, attempt: Callable[[float], Any], timeout: float) -> Any:
        attempts = Attempts(timeout)
        while True:
            try:
                return attempt(attempts.time_left())
            except grpc.RpcError as error:
                time.sleep(attempts.wait_after(self._failure(error, attempts.number)))

    def _failure(self, error: grpc.RpcError, attempts: int) -> PalpateError:
        failure = from_rpc_error(error, attempts)
        if isinstance(failure, NoAnswer):
            # grpcio up to 1.71 looks after a connection only while a call waits for it, and otherwise every five
            # seconds, by when one that is made between two attempts was given up: a server that came back would
            # never be found. So the next attempt makes a connection of its own.
            self._channel = None
        return failure

    def _open(self) -> grpc.Channel:
        if self._channel is None:
            self._channel = connect(self._target, self._access.credentials)
        return self._channel
