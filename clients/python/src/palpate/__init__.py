"""Palpate: reconstruct the shape of an unknown object by touch.

A robot shows what its camera sees, asks where to touch, touches, reports, and has a mesh with its uncertainty at any
time. Lengths are metres, forces newtons, quaternions x, y, z, w, and all points and poses are in the session's one frame.

    import palpate

    with palpate.Client("http://127.0.0.1:7257") as client:
        session = client.create_session(budget=30)
        session.add_prior(points, viewpoint=camera_position)
        palpate.explore(robot, session)
        mesh = session.mesh()

`palpate.aio` has the same for asyncio, `palpate.v1` the messages of the wire contract.
"""

from palpate import aio, simulated, v1
from palpate.calls import ball, half_space, sensor
from palpate.candidates import Candidate, Candidates, ContactAccepted, Proposal, ViewAccepted
from palpate.client import Client
from palpate.errors import (
    EvidenceWarning,
    NoAnswer,
    NoServer,
    PalpateError,
    PermissionDenied,
    Refused,
    Unauthenticated,
)
from palpate.exploration import Explored, Robot, Step, explore
from palpate.local_server import LocalServer, local_server
from palpate.mesh import Mesh
from palpate.outcomes import Contact, InvalidContact, NoContact, ObjectMoved, Outcome, Rejected
from palpate.series import Series
from palpate.session import Session
from palpate.session_view import NotReported
from palpate.streams import Update

__version__ = "0.1.0"

__all__ = [
    "Candidate",
    "Candidates",
    "Client",
    "Contact",
    "ContactAccepted",
    "EvidenceWarning",
    "Explored",
    "InvalidContact",
    "LocalServer",
    "Mesh",
    "NoAnswer",
    "NoContact",
    "NoServer",
    "NotReported",
    "ObjectMoved",
    "Outcome",
    "PalpateError",
    "PermissionDenied",
    "Proposal",
    "Refused",
    "Rejected",
    "Robot",
    "Series",
    "Session",
    "Step",
    "Unauthenticated",
    "Update",
    "ViewAccepted",
    "aio",
    "ball",
    "explore",
    "half_space",
    "local_server",
    "sensor",
    "simulated",
    "v1",
]
