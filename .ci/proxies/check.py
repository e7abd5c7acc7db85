"""Robots and readers behind the proxies of contrib/, and servers that are killed: `check.py CONTRIB ENVOY`."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import numpy as np
import palpate

SERVERS = 3
SESSIONS = 4
CONTACTS = 4  # before the kill, and as many after it
PATIENCE_S = 60
FOUND_AGAIN_S = 3  # how long the proxies leave a server alone that was away, at most
CALLS = re.compile(r'^palpate_calls_total\{method="(ReportContact|GetMesh)",outcome="OK"\} (\d+)$', re.MULTILINE)


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def soon(what: str, is_so, seconds: float = PATIENCE_S) -> None:
    end = time.monotonic() + seconds
    while not is_so():
        if time.monotonic() > end:
            sys.exit(f"{what}: not within {seconds} s")
        time.sleep(0.05)


def read(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=PATIENCE_S) as reply:
        return reply.read()


def answers(url: str) -> bool:
    try:
        return bool(read(url))
    except OSError:
        return False


class Server:
    """One of the servers that share the log."""

    def __init__(self, database: str, port: int) -> None:
        self.database, self.port = database, port
        self.url = f"http://127.0.0.1:{port}"
        self.begin()

    def begin(self) -> None:
        command = [os.environ["PALPATE_BINARY"], "serve", "--log", "error", "--listen", f"127.0.0.1:{self.port}"]
        self.process = subprocess.Popen(command, env={**os.environ, "PALPATE_DATABASE": self.database})
        soon("a server", lambda: answers(f"{self.url}/readyz"))

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def calls(self) -> int:
        return sum(int(count) for _, count in CALLS.findall(read(f"{self.url}/metrics").decode()))


def configuration(example: Path, servers: list[Server], folder: Path) -> tuple[Path, int, int]:
    """The example with ports and folders of this run, its port for gRPC, and the one for HTTP."""
    text = example.read_text()
    grpc, http = free_port(), free_port()
    for number, server in enumerate(servers):
        assert str(7257 + number) in text, f"{example.name} names no server at port {7257 + number}"
        text = text.replace(str(7257 + number), str(server.port))
    if "7251" not in text:
        http = grpc
    text = text.replace("7250", str(grpc)).replace("7251", str(http)).replace("/tmp/palpate-nginx", str(folder / "nginx"))
    (folder / example.name).write_text(text)
    return folder / example.name, grpc, http


def cap() -> np.ndarray:
    """What a camera above sees of a ball of 4 cm at the origin, (N, 3) in metres."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(600, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return 0.04 * directions[directions[:, 2] > 0.5]


def busy(servers: list[Server], before: list[int]) -> list[Server]:
    """Those that were asked about the session since then."""
    return [server for server, count in zip(servers, before, strict=True) if server.calls() > count]


def explore(name: str, servers: list[Server], grpc: int, http: int) -> str:
    """A session through a proxy, whose server is killed half-way; says at which server it was and where it went on."""
    with palpate.Client(f"http://127.0.0.1:{grpc}", timeout=PATIENCE_S) as client:
        before = [server.calls() for server in servers]
        session = client.create_session(name)
        session.add_prior(cap(), (0.0, 0.0, 0.5))
        seen: list[int] = []

        def watch() -> None:
            with palpate.Client(f"http://127.0.0.1:{grpc}", timeout=PATIENCE_S) as watcher:
                for update in watcher.session(name).watch(after_revision=0):
                    if update.event is not None:
                        seen.append(update.event.seq)
                    if len(seen) == 2 + 2 * CONTACTS:
                        return

        watching = threading.Thread(target=watch, daemon=True)
        watching.start()

        def touch(count: int) -> None:
            for _ in range(count):
                session.no_contact(session.candidates()[0])
                # A reader over HTTP is sent to the same server, by the session in the path.
                assert read(f"http://127.0.0.1:{http}/v1/sessions/{name}/mesh?format=ply").startswith(b"ply")

        touch(CONTACTS)
        [at] = busy(servers, before)
        at.kill()
        left = [server for server in servers if server is not at]
        before = [server.calls() for server in left]
        touch(CONTACTS)
        then = busy(left, before)
        assert then, "nobody went on"
        at.begin()
        time.sleep(FOUND_AGAIN_S)
        watching.join(PATIENCE_S)
        assert seen == list(range(1, 3 + 2 * CONTACTS)), f"{name}: a watcher saw {seen}"
        assert [event.seq for event in session.events()] == seen
        return f"{name}: at {at.port}, and after that was killed at {' and '.join(str(other.port) for other in then)}"


def behind(example: Path, command: list[str], servers: list[Server], folder: Path) -> None:
    """Sessions through a proxy that is started with this command and the example."""
    path, grpc, http = configuration(example, servers, folder)
    proxy = subprocess.Popen([*command, str(path)])
    try:
        soon(example.name, lambda: answers(f"http://127.0.0.1:{http}/readyz"))
        for number in range(SESSIONS):
            name = f"{example.stem}-{number}"
            print(f"{example.name}: {explore(name, servers, grpc, http)}", flush=True)
    finally:
        proxy.terminate()
        proxy.wait()


def main() -> None:
    contrib, envoy = Path(sys.argv[1]), sys.argv[2]
    folder = Path.cwd()
    postgres = os.environ["PALPATE_TEST_POSTGRES"]
    subprocess.run(["psql", "--quiet", f"{postgres}/postgres", "-c", "create database palpate"], check=True)
    servers: list[Server] = []
    try:
        for _ in range(SERVERS):
            servers.append(Server(f"{postgres}/palpate", free_port()))
        for example, command in [
            ("nginx.conf", ["nginx", "-p", str(folder), "-g", "daemon off;", "-c"]),
            ("envoy.yaml", [envoy, "--use-dynamic-base-id", "--log-level", "error", "--config-path"]),
        ]:
            behind(contrib / example, command, servers, folder)
    finally:
        for server in servers:
            server.kill()


main()
