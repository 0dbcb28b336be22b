"""Messages of every type that rclpy has here: as rclpy serializes them, and as the console reads and writes them.

Prints one line for each type that differs, and at last how many were tried.
"""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import json
import random
import sys
from array import array
from base64 import b64encode
from importlib import import_module
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message

from robots.bridge.ros2.definitions import UnknownTypeError, definition
from robots.shared.messages.packing import Detail
from robots.shared.messages.serialization import CDR
from robots.shared.messages.whole import json_encoder
from robots.shared.ros2.environment import MESSAGES, WHEELS

WHOLE = Detail(whole=10_000, first=10_000, text=10_000)
PER_TYPE = 4


def types() -> list[tuple[str, Any]]:
    found = []
    for prefix in (WHEELS, MESSAGES):
        for file in sorted((prefix / "share").glob("*/msg/*.msg")):
            package = file.parts[-3]
            found.append((f"{package}/msg/{file.stem}", getattr(import_module(f"{package}.msg"), file.stem)))
        for file in sorted((prefix / "share").glob("*/srv/*.srv")):
            kind = getattr(import_module(f"{file.parts[-3]}.srv"), file.stem)
            for part in ("Request", "Response"):
                found.append((f"{file.parts[-3]}/srv/{file.stem}_{part}", getattr(kind, part)))
        for file in sorted((prefix / "share").glob("*/action/*.action")):
            kind = getattr(import_module(f"{file.parts[-3]}.action"), file.stem)
            name = f"{file.parts[-3]}/action/{file.stem}"
            parts = {part: getattr(kind, part) for part in ("Goal", "Result", "Feedback")}
            parts["FeedbackMessage"] = kind.Impl.FeedbackMessage
            parts["SendGoal_Request"] = kind.Impl.SendGoalService.Request
            parts["GetResult_Response"] = kind.Impl.GetResultService.Response
            found += [(f"{name}_{part}", each) for part, each in parts.items()]
    return found


def fill(message: Any, dice: random.Random) -> Any:
    """Give each field a value of its type."""
    for name, kind in message.get_fields_and_field_types().items():
        setattr(message, name, value(kind, getattr(message, name), dice))
    return message


def value(kind: str, blank: Any, dice: random.Random) -> Any:
    if kind.startswith("sequence<"):
        inner, _, most = kind.removeprefix("sequence<").removesuffix(">").partition(", ")
        values = [value(inner, None, dice) for _ in range(dice.randrange(min(4, int(most or 4) + 1)))]
        return array(blank.typecode, values) if isinstance(blank, array) else values
    if kind.endswith("]"):
        inner = kind[: kind.rindex("[")]
        values = [value(inner, None, dice) for _ in range(len(blank))]
        return np.array(values, dtype=blank.dtype) if isinstance(blank, np.ndarray) else values
    if kind == "boolean":
        return dice.random() < 0.5
    if kind in ("float", "double"):
        return dice.randrange(-2000, 2000) / 2  # people see seven digits of a float32
    if kind == "octet":
        return bytes([dice.randrange(256)])
    if kind.startswith("string"):
        return "".join(dice.choices("abcé ", k=dice.randrange(9)))
    if kind.startswith(("int", "uint")):
        bits = int(kind.lstrip("uint"))
        low = 0 if kind[0] == "u" else -(2 ** (bits - 1))
        return dice.randrange(low, low + 2**bits)
    package, _, name = kind.partition("/")
    name, _, part = name.partition("_")
    found = getattr(import_module(f"{package}.{'action' if part else 'msg'}"), name)
    return fill((getattr(found, part) if part else found)(), dice)


def with_base64(shown: Any, sent: Any) -> Any:
    """Write arrays of bytes as programs get them."""
    if isinstance(shown, dict):
        return {name: with_base64(one, sent[name]) for name, one in shown.items()}
    if isinstance(shown, list) and isinstance(sent, str):
        return b64encode(bytes(shown)).decode()
    return (
        [with_base64(*both) for both in zip(shown, sent, strict=True)] if isinstance(shown, list) else shown
    )


def main() -> None:
    dice = random.Random(int(sys.argv[1]))  # noqa: S311
    tried = 0
    for name, kind in types():
        try:
            known = definition(name)
        except UnknownTypeError as error:
            print("unknown", name, error, flush=True)
            continue
        tried += 1
        encode = json_encoder(known.fields, CDR)
        for _ in range(PER_TYPE):
            data = serialize_message(fill(kind(), dice))
            try:
                shown, shortened = known.layout.read(data, WHOLE)
                sent = json.loads(encode(data))
                again = known.layout.write(shown, (0, 0))
            except Exception as error:  # noqa: BLE001
                print("differs", name, repr(error), data.hex(), flush=True)
                break
            same = deserialize_message(again, kind) == deserialize_message(data, kind)
            if shortened or not same or with_base64(shown, sent) != sent:
                print("differs", name, shown, flush=True)
                break
    print("tried", tried, flush=True)


if __name__ == "__main__":
    main()
