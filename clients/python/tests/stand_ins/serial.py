"""A stand-in for `serial` of pyserial: a load cell that sends a line of newtons at a time, for ever."""

from __future__ import annotations

from hand import HAND


class Serial:
    def __init__(self, port: str, baudrate: int) -> None:
        assert port.startswith("/dev/") and baudrate == 115200
        self.is_new = False
        self.is_whole = False

    def reset_input_buffer(self) -> None:
        self.is_new, self.is_whole = True, False

    def readline(self) -> bytes:
        """What waited in the buffer is old, and the first line after it was emptied is the end of one."""
        line = f"{HAND.newtons() if self.is_new else 9.9:.3f}\r\n".encode()
        if not self.is_whole:
            self.is_whole = True
            return line[3:]
        return line
