"""Tokens and certificates, against a real server that asks for them."""

from __future__ import annotations

import asyncio
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import trustme

import palpate
from palpate.access import access
from palpate.simulated import Ball

BALL = Ball(center=(0.5, 0.0, 0.1), radius=0.04)


def program() -> str:
    return os.environ.get("PALPATE_BINARY", "palpate")


def token(database: Path, name: str, *more: str) -> str:
    command = [program(), "token", "create", "--database", str(database), "--name", name, *more]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


class Lab:
    """A server that asks who calls and speaks TLS, by the lab's own authority."""

    def __init__(self, folder: Path, options: list[str]):
        self.authority = trustme.CA()
        self.ca = folder / "ca.pem"
        self.authority.cert_pem.write_to_path(self.ca)
        self.database = folder / "palpate.db"
        self.robot = token(self.database, "arm-1")
        self.wall = token(self.database, "wall", "--scope", "read")
        if "--tls-cert" in options:
            served = self.authority.issue_cert("127.0.0.1", "localhost")
            served.cert_chain_pems[0].write_to_path(folder / "cert.pem")
            served.private_key_pem.write_to_path(folder / "key.pem")
        options = [str(folder / word) if word.endswith(".pem") else word for word in options]
        self.server = palpate.local_server(database=self.database, options=["--require-tokens", *options])

    def identity(self, name: str) -> tuple[bytes, bytes]:
        issued = self.authority.issue_cert(f"{name.replace(':', '-')}.lab", common_name=name)
        return issued.cert_chain_pems[0].bytes(), issued.private_key_pem.bytes()


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    lab = Lab(tmp_path_factory.mktemp("plain"), [])
    with lab.server:
        yield lab


@pytest.fixture(scope="module")
def encrypted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    options = ["--tls-cert", "cert.pem", "--tls-key", "key.pem", "--tls-client-ca", "ca.pem"]
    lab = Lab(tmp_path_factory.mktemp("tls"), options)
    with lab.server:
        yield lab


def test_a_token_says_who_calls_and_the_log_has_its_name(plain: Lab) -> None:
    with palpate.Client(plain.server.url, token=plain.robot) as client:
        session = client.create_session(table_z=0.06)
        session.add_prior(BALL.seen_from((0.5, 0.0, 0.6)), viewpoint=(0.5, 0.0, 0.6))
        assert {event.actor.split("/")[0] for event in session.events()} == {"arm-1"}
        assert plain.robot not in repr(client) and plain.robot not in repr(client._access)


def test_the_environment_may_have_the_token(plain: Lab, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PALPATE_TOKEN", plain.wall)
    with palpate.Client(plain.server.url) as client:
        assert isinstance(list(client.sessions()), list)
    monkeypatch.delenv("PALPATE_TOKEN")
    (tmp_path / "token").write_text(plain.wall + "\n")
    monkeypatch.setenv("PALPATE_TOKEN_FILE", str(tmp_path / "token"))
    with palpate.Client(plain.server.url) as client:
        assert client.connect().version


def test_who_is_not_known_is_told_what_to_do_at_once(plain: Lab) -> None:
    with pytest.raises(palpate.Unauthenticated, match="palpate token create") as none:
        palpate.Client(plain.server.url).connect()
    assert (none.value.reason, none.value.attempts) == ("TOKEN_MISSING", 1)
    wrong = plain.robot[:-4] + ("0000" if not plain.robot.endswith("0000") else "1111")
    with pytest.raises(palpate.Unauthenticated, match="mistyped") as refused:
        palpate.Client(plain.server.url, token=wrong).connect()
    assert wrong not in str(refused.value)
    with palpate.Client(plain.server.url, token=plain.wall) as client:
        with pytest.raises(palpate.PermissionDenied, match="the scope robot") as denied:
            client.create_session()
        assert (denied.value.reason, denied.value.attempts) == ("SCOPE_DENIED", 1)


def test_a_watch_ends_when_its_token_is_revoked(plain: Lab) -> None:
    guest = token(plain.database, "guest")
    with palpate.Client(plain.server.url, token=plain.robot) as robot:
        session_id = robot.create_session().id
    with palpate.Client(plain.server.url, token=guest) as client:
        updates = client.session(session_id).watch(0)
        next(updates)
        revoke = [program(), "token", "revoke", "--database", str(plain.database), "guest"]
        subprocess.run(revoke, check=True, capture_output=True)
        with pytest.raises(palpate.Unauthenticated):
            for _ in updates:
                pass


def test_a_session_over_tls_with_a_token_and_with_a_certificate(encrypted: Lab) -> None:
    url = encrypted.server.url
    assert url.startswith("https://")
    with palpate.Client(url, token=encrypted.robot, ca=encrypted.ca) as client:
        session_id = client.create_session().id
    certificate, key = encrypted.identity("read:screen")
    ca = encrypted.ca.read_bytes()
    with palpate.Client(url, ca=ca, certificate=certificate, key=key) as client:
        assert client.session(session_id).id == session_id
        with pytest.raises(palpate.PermissionDenied):
            client.create_session()
    certificate, key = encrypted.identity("robot:arm-2")
    with palpate.Client(url, ca=str(encrypted.ca), certificate=certificate, key=key) as client:
        session = client.create_session()
        assert [event.actor for event in session.events()] == ["arm-2/certificate"]


def test_a_server_that_is_not_trusted_is_not_called(encrypted: Lab) -> None:
    with pytest.raises(palpate.NoServer, match="`ca=`"):
        palpate.Client(encrypted.server.url, token=encrypted.robot, connect_timeout=1.0).connect()


def test_a_server_that_speaks_tls_is_not_called_in_the_clear(encrypted: Lab) -> None:
    url = encrypted.server.url.replace("https://", "http://")
    with pytest.raises(palpate.NoServer, match="https://"):
        palpate.Client(url, token=encrypted.robot, connect_timeout=1.0).connect()


def test_asyncio_calls_over_tls_as_well(encrypted: Lab) -> None:
    async def run() -> str:
        url = encrypted.server.url
        async with palpate.aio.Client(url, token=encrypted.robot, ca=encrypted.ca) as client:
            return (await client.create_session()).id

    assert asyncio.run(run())


def test_asyncio_is_told_as_well_who_may_not_and_knows_callers_by_their_certificates(encrypted: Lab) -> None:
    async def run() -> None:
        url, ca = encrypted.server.url, encrypted.ca
        async with palpate.aio.Client(url, token=encrypted.wall, ca=ca) as wall:
            with pytest.raises(palpate.PermissionDenied):
                await wall.create_session()
        certificate, key = encrypted.identity("robot:arm-3")
        guest = token(encrypted.database, "passer-by")
        async with palpate.aio.Client(url, ca=ca, certificate=certificate, key=key) as robot:
            session_id = (await robot.create_session()).id
        async with palpate.aio.Client(url, token=guest, ca=ca) as client:
            updates = (await client.session(session_id)).watch(0)
            await updates.__anext__()
            command = [program(), "token", "revoke", "--database", str(encrypted.database), "passer-by"]
            subprocess.run(command, check=True, capture_output=True)
            with pytest.raises(palpate.Unauthenticated):
                async for _ in updates:
                    pass

    asyncio.run(run())


def test_a_robot_explores_with_a_token(plain: Lab) -> None:
    with palpate.Client(plain.server.url, token=plain.robot) as client:
        session = client.create_session(table_z=0.06)
        session.add_prior(BALL.seen_from((0.5, 0.0, 0.6)), viewpoint=(0.5, 0.0, 0.6))
        assert palpate.explore(BALL, session, 3).attempts == 3


def test_an_environment_for_the_lab_leaves_other_servers_alone(
    server: palpate.LocalServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PALPATE_CA", "PALPATE_CERTIFICATE", "PALPATE_KEY"):
        monkeypatch.setenv(name, "/nowhere.pem")
    with palpate.Client(server.url) as client:
        assert client.connect().version
    with pytest.raises(FileNotFoundError, match="/nowhere.pem"):
        palpate.Client("https://lab")


def test_what_cannot_be_is_named_before_anything_is_sent(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="one word"):
        palpate.Client(token="two words")
    with pytest.raises(ValueError, match="https://"):
        palpate.Client(ca=b"-----BEGIN CERTIFICATE-----")
    with pytest.raises(ValueError, match="belong together"):
        palpate.Client("https://lab", certificate=b"-----BEGIN CERTIFICATE-----")
    (tmp_path / "ca.pem").write_text("nothing")
    with pytest.raises(ValueError, match="ca: .* no PEM file"):
        palpate.Client("https://lab", ca=tmp_path / "ca.pem")
    with pytest.raises(FileNotFoundError, match="nowhere.pem"):
        palpate.Client("https://lab", ca=tmp_path / "nowhere.pem")
    with pytest.raises(FileNotFoundError) as refused:
        palpate.Client("https://lab", certificate=b"-----BEGIN CERTIFICATE-----", key="c2VjcmV0")
    assert "c2VjcmV0" not in str(refused.value)


def test_a_token_in_the_clear_to_another_machine_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="in the clear"):
        access("http://lab:7257", "abc", None, None, None)
