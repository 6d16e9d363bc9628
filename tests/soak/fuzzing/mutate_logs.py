"""Damaging the binary logs of autopilots, a message at a time, so that what is damaged is still read as messages."""

import struct

import numpy as np

FMT, FMT_LENGTH = 0x80, 89
EXTREMES = (  # of fields: all bits, none, the ends of integers, floats that are none or too large
    b"\xff" * 8,
    b"\0" * 8,
    b"\0" * 7 + b"\x80",
    b"\xff" * 7 + b"\x7f",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"\xff\x7f",
    struct.pack("<f", np.nan),
    struct.pack("<f", np.inf),
    struct.pack("<f", -3e38),
    struct.pack("<d", np.nan),
    struct.pack("<d", 1e300),
)
LARGEST = 900_000  # bytes


def damaged_log(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a .bin or .tlog with one to four damages: cut, joined anew, fields and lengths that cannot be, floods."""
    split, mended = (_dataflash, _as_it_is) if data[:2] == b"\xa3\x95" else (_frames, _with_checksum)
    messages = split(data)
    for _ in range(int(rng.integers(1, 5))):
        i, j = sorted(rng.integers(0, len(messages), 2).tolist())
        kind = rng.integers(0, 7)
        if kind == 0:  # a piece goes elsewhere, or is there twice
            piece = messages[i : j + 1]
            at = int(rng.integers(0, len(messages)))
            messages = messages[:i] + messages[j + 1 :] if rng.random() < 0.5 and len(piece) < len(messages) else messages
            messages[at:at] = piece
        elif kind == 1 and j - i + 1 < len(messages):
            del messages[i : j + 1]
        elif kind == 2:
            times = int(rng.choice([2, 40, LARGEST], p=[0.5, 0.45, 0.05]))
            messages[i:i] = [messages[i]] * min(times, LARGEST // max(1, len(messages[i])))
        elif kind == 3:
            messages[i] = messages[i][: rng.integers(0, len(messages[i]) + 1)]
        elif kind == 4:
            head = int(rng.integers(0, min(FMT_LENGTH, len(messages)) // 4 + 1))  # what says what all others are
            messages[head] = _overwritten(messages[head], bytes([rng.integers(0, 256)]), rng)
        else:
            every = range(i, j + 1) if rng.random() < 0.2 else [i]
            value = EXTREMES[rng.integers(0, len(EXTREMES))]
            for k in every:
                messages[k] = mended(_overwritten(messages[k], value, rng))
    made = b"".join(messages)
    return made[: rng.integers(0, len(made) + 1)] if rng.random() < 0.1 else made[: 2 * LARGEST]


def _overwritten(message: bytes, value: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(0, len(message) + 1))
    return (message[:at] + value + message[at + len(value) :])[: len(message)]


def _dataflash(data: bytes) -> list[bytes]:
    """Return a sound .bin's messages: their lengths stand in its FMT messages."""
    lengths, messages, at = {FMT: FMT_LENGTH}, [], 0
    while at < len(data):
        kind = data[at + 2]
        message = data[at : at + lengths[kind]]
        if kind == FMT:
            lengths[message[3]] = message[4]
        messages.append(message)
        at += len(message)
    return messages


def _frames(data: bytes) -> list[bytes]:
    """Return a sound .tlog's messages: eight bytes of time, then a frame of MAVLink 2 without signature."""
    messages, at = [], 0
    while at < len(data):
        end = at + 8 + 10 + data[at + 9] + 2
        messages.append(data[at:end])
        at = end
    return messages


def _as_it_is(message: bytes) -> bytes:
    return message


def _with_checksum(message: bytes) -> bytes:
    """Return a frame whose checksum fits what it says now, if it is of a kind that is known."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    length = len(message) - 20
    kind = mavlink.mavlink_map.get(int.from_bytes(message[15:18], "little")) if length >= 0 else None
    if kind is None:
        return message
    crc = mavlink.x25crc(message[9:-2])
    crc.accumulate(bytes([kind.crc_extra]))
    return message[:-2] + struct.pack("<H", crc.crc)
