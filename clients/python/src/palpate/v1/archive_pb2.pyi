from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class LoggedEvent(_message.Message):
    __slots__ = ("seq", "request_id", "request_digest", "kind", "payload", "reply", "state_hash", "stats_after", "algorithm_version", "append_us", "actor", "link")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    REQUEST_DIGEST_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    REPLY_FIELD_NUMBER: _ClassVar[int]
    STATE_HASH_FIELD_NUMBER: _ClassVar[int]
    STATS_AFTER_FIELD_NUMBER: _ClassVar[int]
    ALGORITHM_VERSION_FIELD_NUMBER: _ClassVar[int]
    APPEND_US_FIELD_NUMBER: _ClassVar[int]
    ACTOR_FIELD_NUMBER: _ClassVar[int]
    LINK_FIELD_NUMBER: _ClassVar[int]
    seq: int
    request_id: str
    request_digest: bytes
    kind: str
    payload: bytes
    reply: bytes
    state_hash: str
    stats_after: bytes
    algorithm_version: str
    append_us: int
    actor: str
    link: bytes
    def __init__(self, seq: _Optional[int] = ..., request_id: _Optional[str] = ..., request_digest: _Optional[bytes] = ..., kind: _Optional[str] = ..., payload: _Optional[bytes] = ..., reply: _Optional[bytes] = ..., state_hash: _Optional[str] = ..., stats_after: _Optional[bytes] = ..., algorithm_version: _Optional[str] = ..., append_us: _Optional[int] = ..., actor: _Optional[str] = ..., link: _Optional[bytes] = ...) -> None: ...
