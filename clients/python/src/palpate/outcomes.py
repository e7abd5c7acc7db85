"""What can come of an approach. Positions are metres in the session's frame, x, y, z, w is the order of quaternions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import TypeAlias

import numpy as np

from palpate import v1
from palpate.candidates import Candidate
from palpate.names import enum_value
from palpate.poses import PoseLike, VectorLike, has_quaternion, matrix, pose_message, vector, vector_message


@dataclass(frozen=True, eq=False)
class Contact:
    """The pad's face touched something.

    Attributes:
        pose: of the pad at the contact: the origin is the centre of its face, z points out of it, into the object.
            A 4x4 matrix, or (position, quaternion). A position alone (3,) means that the pad was turned as the candidate
            asked.
        force: (3,) N, on the tared sensor, in the sensor's own frame: pressing on an object gives a negative z.
        torque: (3,) N m, about the centre of the pad's face, in the sensor's own frame; it says where on the pad the
            touch was. Leave it out for a sensor that measures none.
        rest_force, rest_torque: what an untared sensor showed before the approach; they are subtracted.
        sensor_id: which pad touched; by default the one that the candidate asks for.
        swept_from: (3,) where the pad's centre began its approach: from there to the contact space is free.
        normal: (3,) measured outward unit normal of the surface, for sensors that see it.
        uncertainty: in [0, 1], the caller's own; by default the server takes it from the wrench.
    """

    pose: PoseLike | VectorLike
    force: VectorLike | None = None
    torque: VectorLike | None = None
    rest_force: VectorLike | None = None
    rest_torque: VectorLike | None = None
    sensor_id: str = ""
    swept_from: VectorLike | None = None
    normal: VectorLike | None = None
    uncertainty: float | None = None


@dataclass(frozen=True, eq=False)
class NoContact:
    """The approach went its whole length and touched nothing, so that the space it swept is free.

    Attributes:
        swept_from, swept_to: (3,) where the pad's centre began and gave up; by default the candidate's start and end.
        sweep_radius_m: radius about the path that is known to be free: half the pad's side for a wide pad.
    """

    swept_from: VectorLike | None = None
    swept_to: VectorLike | None = None
    sweep_radius_m: float = 0.0


@dataclass(frozen=True, eq=False)
class InvalidContact:
    """Something else than the pad's face touched: where on the object is not known.

    Attributes:
        pose: of the pad at that moment, as in `Contact`.
        detail: what the robot knows of it.
    """

    pose: PoseLike | VectorLike
    detail: str = ""


@dataclass(frozen=True)
class Rejected:
    """The robot did not make the approach.

    Attributes:
        reason: NO_IK, COLLISION, SAFETY_STOP, TIMEOUT or OPERATOR.
        detail: what the robot knows of it.
    """

    reason: str
    detail: str = ""


@dataclass(frozen=True, eq=False)
class ObjectMoved:
    """Something pushed the object: what was known moves with it.

    Attributes:
        new_from_old: the rigid motion in the session's frame: it takes a point of the object from where it was to where
            it is. A 4x4 matrix, or (translation, quaternion).
        std_m: how well it is known, in metres.
        detail: what happened.
    """

    new_from_old: PoseLike
    std_m: float = 0.0
    detail: str = ""


#: What a robot's `touch` returns: `None` is a `NoContact` of the candidate's whole way, and several contacts at once,
#: of several pads, are one attempt.
Outcome: TypeAlias = Contact | Sequence[Contact] | NoContact | InvalidContact | Rejected | ObjectMoved | None


def result(
    candidate: Candidate | None, outcome: Outcome, robot_id: str = "", observe_time: datetime | None = None
) -> v1.ContactResult:
    """The message for `outcome` of the approach to `candidate`; `None` for one that was not proposed."""
    message = v1.ContactResult(candidate_id=candidate.id if candidate else "", robot_id=robot_id)
    if observe_time is not None:
        if not isinstance(observe_time, datetime):
            raise ValueError(f"observe_time is a {type(observe_time).__name__}: a datetime is expected")
        # Without a zone it is this machine's own time.
        message.observe_time.FromDatetime(observe_time.astimezone(timezone.utc))
    match outcome:
        case None:
            message.no_contact.CopyFrom(_no_contact(candidate, NoContact()))
        case Contact():
            message.contact.CopyFrom(_contact(candidate, outcome))
        case NoContact():
            message.no_contact.CopyFrom(_no_contact(candidate, outcome))
        case InvalidContact():
            message.invalid_contact.sensor_pose.CopyFrom(_pad_pose(candidate, outcome.pose, ""))
            message.invalid_contact.detail = outcome.detail
        case Rejected():
            message.rejected.reason = enum_value(v1.RejectReason, outcome.reason, "reason")
            message.rejected.detail = outcome.detail
        case ObjectMoved():
            message.object_moved.new_from_old.CopyFrom(pose_message(outcome.new_from_old, "new_from_old"))
            message.object_moved.std_m, message.object_moved.detail = outcome.std_m, outcome.detail
        case [*contacts] if contacts and all(isinstance(contact, Contact) for contact in contacts):
            message.contacts.contacts.extend(_contact(candidate, contact) for contact in contacts)
        case _:
            raise TypeError(
                f"the outcome is a {type(outcome).__name__}: a Contact, NoContact, InvalidContact, Rejected or ObjectMoved "
                "is expected, or None for no contact"
            )
    return message


def _contact(candidate: Candidate | None, contact: Contact) -> v1.Contact:
    sensor_id = contact.sensor_id or (candidate.sensor_id if candidate else "")
    message = v1.Contact(sensor_pose=_pad_pose(candidate, contact.pose, sensor_id), sensor_id=sensor_id)
    if contact.force is not None or contact.torque is not None:
        message.wrench.CopyFrom(_wrench(contact.force, contact.torque, ""))
    if contact.rest_force is not None or contact.rest_torque is not None:
        message.rest_wrench.CopyFrom(_wrench(contact.rest_force, contact.rest_torque, "rest_"))
    if contact.swept_from is not None:
        message.swept_from.CopyFrom(vector_message(contact.swept_from, "swept_from"))
    if contact.normal is not None:
        message.normal.CopyFrom(vector_message(contact.normal, "normal"))
    if contact.uncertainty is not None:
        message.uncertainty = contact.uncertainty
    return message


def _wrench(force: VectorLike | None, torque: VectorLike | None, prefix: str) -> v1.Wrench:
    zero = np.zeros(3)
    return v1.Wrench(
        force=vector_message(zero if force is None else force, f"{prefix}force"),
        torque=vector_message(zero if torque is None else torque, f"{prefix}torque"),
    )


def _no_contact(candidate: Candidate | None, outcome: NoContact) -> v1.NoContact:
    ends = []
    for name, given, usual in (
        ("swept_from", outcome.swept_from, "start"),
        ("swept_to", outcome.swept_to, "end"),
    ):
        if given is None and candidate is None:
            raise ValueError(f"{name} is missing: without a candidate, where the approach went is not known")
        ends.append(vector_message(getattr(candidate, usual) if given is None else given, name))
    return v1.NoContact(swept_from=ends[0], swept_to=ends[1], sweep_radius_m=outcome.sweep_radius_m)


def _pad_pose(candidate: Candidate | None, pose: PoseLike | VectorLike, sensor_id: str) -> v1.Pose:
    if has_quaternion(pose) or np.ndim(np.asarray(pose)) != 1:
        return pose_message(pose, "pose")
    if candidate is None or sensor_id != candidate.sensor_id:
        raise ValueError("pose is a position only: how the pad was turned is known only for the candidate's own pad")
    transform = candidate.pad_pose.copy()
    transform[:3, 3] = vector(pose, "pose")
    return pose_message(matrix(transform, "pose"), "pose")
