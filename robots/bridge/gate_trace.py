"""Record a gate's inputs and verdicts, and replay them.

A file is gzip of frames. A frame is a length (4 bytes, big-endian) and a msgpack value: first the gate's profile, then
``[method, arguments, answer]`` for each call of ``observe_...``, ``forget`` and ``decide``, in order. Numbers are exact
to the last bit, including NaN and infinities.
"""

from __future__ import annotations

import gzip
import inspect
import struct
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, NamedTuple, cast, get_type_hints

import msgspec
import numpy as np

from robots.bridge.gate.gate import Gate
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import Sentence

# msgpack extension: dtype name, zero byte, C or F for the order, shape as text, zero byte, numbers. Keep the order:
# numpy sums in it, and another order may change the last bit.
_ARRAY = 1
_LARGEST_FRAME = 16 * 1024 * 1024
_LENGTH = struct.Struct(">I")


class BadTrace(ValueError):
    """A file that is no trace, or that is damaged; the text says why."""


class Decision(NamedTuple):
    """One decision: the recorded verdict, and the verdict of the replay."""

    now_s: float
    asked: Velocity
    recorded: Verdict
    replayed: Verdict

    @property
    def same(self) -> bool:
        """Return whether every bit of the verdict is equal."""
        return _encoder.encode(self.recorded) == _encoder.encode(self.replayed)


class Recorder:
    """Context manager that writes all calls of a gate to a file (`recorded`)."""

    def __init__(self, path: Path, profile: GateProfile) -> None:
        self._file = gzip.open(path, "wb", compresslevel=3)  # noqa: SIM115 - closed on leaving the context
        self._write(profile)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def recorded(self, gate: Gate) -> Gate:
        """Return the same gate; its calls are recorded from now on."""
        for method in _methods():
            setattr(gate, method, self._noted(gate, method))
        return gate

    def _noted(self, gate: Gate, method: str) -> Callable[..., Any]:
        call = getattr(gate, method)
        signature = inspect.signature(call)

        @wraps(call)
        def note(*args: Any, **named: Any) -> Any:
            answer = call(*args, **named)
            bound = signature.bind(*args, **named)
            bound.apply_defaults()
            shown = _with_limits(gate, answer, bound.args[2]) if method == "decide" else None
            self._write((method, list(bound.args), shown))
            return answer

        return note

    def _write(self, frame: object) -> None:
        raw = _encoder.encode(frame)
        self._file.write(_LENGTH.pack(len(raw)) + raw)


def replay(path: Path, gate_of: Callable[[GateProfile], Gate] = Gate) -> Iterator[Decision]:
    """Send the recorded inputs to a new gate. Raises BadTrace if the file is damaged."""
    frames = _frames(path)
    try:
        gate = gate_of(msgspec.msgpack.decode(next(frames), type=GateProfile))
    except (StopIteration, msgspec.MsgspecError) as error:
        raise BadTrace(f"{path.name} does not begin with a gate’s profile") from error
    arguments = {method: _kinds(getattr(Gate, method)) for method in _methods()}
    for number, frame in enumerate(frames, 1):
        try:
            method, given, answer = _decoder.decode(frame)
            kinds = arguments[method][: len(given)]  # an older trace has fewer
            args = [_converted(value, kind) for value, kind in zip(given, kinds, strict=True)]
        except (KeyError, TypeError, ValueError, msgspec.MsgspecError) as error:
            raise BadTrace(f"{path.name}: call {number} cannot be decoded: {error}") from error
        replayed = getattr(gate, method)(*args)
        if method == "decide":
            recorded = msgspec.convert(answer, Verdict)
            yield Decision(args[2], args[0], recorded, _with_limits(gate, replayed, args[2]))


def _with_limits(gate: Gate, verdict: Verdict, now_s: float) -> Verdict:
    """Return the verdict with the speed limits that are shown next to it."""
    return verdict._replace(limits=gate.limits(now_s))


def _frames(path: Path) -> Iterator[bytes]:
    try:
        with gzip.open(path, "rb") as file:
            while head := file.read(_LENGTH.size):
                [length] = _LENGTH.unpack(head)
                frame = file.read(min(length, _LARGEST_FRAME))
                if len(frame) != length:
                    raise BadTrace(f"{path.name} ends in the middle of a call")
                yield frame
    except (OSError, EOFError, struct.error) as error:
        raise BadTrace(f"{path.name} is not a trace of a gate, or is damaged: {error}") from error


def _methods() -> list[str]:
    return [name for name in vars(Gate) if name.startswith("observe_") or name in ("forget", "decide")]


def _kinds(method: Callable[..., Any]) -> list[Any]:
    """Return the types of a method's arguments without `self`."""
    hints = get_type_hints(method)
    return [hints[name] for name in list(inspect.signature(method).parameters)[1:]]


def _converted(value: Any, kind: Any) -> Any:
    return value if isinstance(value, np.ndarray) else msgspec.convert(value, kind)


def _packed(value: Any) -> msgspec.msgpack.Ext | str:
    if isinstance(value, Sentence):
        return str(value)
    if not isinstance(value, np.ndarray):
        raise NotImplementedError(f"a {type(value).__name__} cannot be recorded")
    order: Literal["C", "F"] = "F" if value.flags.f_contiguous and not value.flags.c_contiguous else "C"
    shape = ",".join(map(str, value.shape))
    head = f"{value.dtype.str}\0{order}{shape}\0".encode()
    return msgspec.msgpack.Ext(_ARRAY, head + value.tobytes(order))


def _unpacked(code: int, raw: memoryview) -> Any:
    if code != _ARRAY:
        raise ValueError(f"unknown extension {code}")
    dtype, ordered, numbers = bytes(raw).split(b"\0", 2)
    order, shape = ordered.decode()[:1], ordered.decode()[1:]
    sizes = [int(size) for size in shape.split(",") if size]
    flat = np.frombuffer(numbers, dtype=np.dtype(dtype.decode()))
    return flat.reshape(sizes, order="F" if order == "F" else "C")


_encoder = msgspec.msgpack.Encoder(enc_hook=_packed)
_decoder = msgspec.msgpack.Decoder(ext_hook=cast(Any, _unpacked))
