"""Writes Python packages for ROS definition files, with genmsg and genpy.

Each `<package>/msg/_<Type>.py` contains one class, as with catkin; the packages' own ``__init__`` loads a
class at its first use, because loading all of them is slow.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path

import genmsg
from genmsg.msg_loader import load_depends, load_msg_from_string, load_srv_from_string
from genpy.generator import msg_generator, srv_generator

_EMBEDDED = "=" * 80  # separates a type's text from the types it embeds
_HEADER = "std_msgs/Header"

_LAZY_PACKAGE = '''"""Generated: loads each class when it is asked for."""

from importlib import import_module


def __getattr__(name):
    if name.startswith("_"):
        raise AttributeError(name)
    try:
        module = import_module(f"{__name__}._{name}")
    except ModuleNotFoundError:
        raise AttributeError(f"{__name__} has no {name}") from None
    globals()[name] = found = getattr(module, name)
    return found
'''


def generate(definitions: Iterable[Path], folder: Path) -> None:
    """Write the packages of all `definitions` (``<package>/<msg|srv|action>/<Type>.<kind>``) into `folder`."""
    context = genmsg.MsgContext.create_default()
    messages: dict[str, str] = {}
    services: dict[str, str] = {}
    for file in definitions:
        name = f"{file.parts[-3]}/{file.stem}"
        if file.suffix == ".action":
            messages |= action_messages(name, file.read_text())
        else:
            (messages if file.suffix == ".msg" else services)[name] = file.read_text()

    specs = {name: load_msg_from_string(context, text, name) for name, text in messages.items()}
    service_specs = {name: load_srv_from_string(context, text, name) for name, text in services.items()}
    for spec in (*specs.values(), *service_specs.values()):
        _register_embedded(context, spec)
    for name, spec in specs.items():
        _write(folder, name, "msg", msg_generator(context, spec, {}))
    for name, spec in service_specs.items():
        load_depends(context, spec, {})
        _write(folder, name, "srv", srv_generator(context, spec, {}))


def action_messages(name: str, text: str) -> dict[str, str]:
    """Return the seven message types of an action file: name -> definition."""
    package, _, short = name.partition("/")
    goal, result, feedback = re.split(r"^-{3,}[^\S\n]*$", text, flags=re.MULTILINE)
    stamped = "std_msgs/Header header\nactionlib_msgs/{status}\n{short}{part} {field}\n"
    parts = {
        "Goal": goal,
        "Result": result,
        "Feedback": feedback,
        "ActionGoal": stamped.format(status="GoalID goal_id", short=short, part="Goal", field="goal"),
        "ActionResult": stamped.format(
            status="GoalStatus status", short=short, part="Result", field="result"
        ),
        "ActionFeedback": stamped.format(
            status="GoalStatus status", short=short, part="Feedback", field="feedback"
        ),
        "Action": "".join(
            f"{short}Action{part} action_{part.lower()}\n" for part in ("Goal", "Result", "Feedback")
        ),
    }
    return {f"{package}/{short}{part}": definition.strip() for part, definition in parts.items()}


def _register_embedded(context: genmsg.MsgContext, spec: genmsg.MsgSpec | genmsg.SrvSpec) -> None:
    """Register the installed types that `spec` embeds in `context`, from the text in their classes."""
    fields = spec.types if isinstance(spec, genmsg.MsgSpec) else spec.request.types + spec.response.types
    for field in fields:
        bare = genmsg.msgs.bare_msg_type(field)
        name = _HEADER if bare == "Header" else bare
        if genmsg.msgs.is_builtin(name) or context.is_registered(name):
            continue
        package, short = name.split("/")
        text = getattr(import_module(f"{package}.msg"), short)._full_text.split(_EMBEDDED)[0]
        _register_embedded(context, load_msg_from_string(context, text, name))


def _write(folder: Path, name: str, kind: str, lines: Iterator[str]) -> None:
    package, _, short = name.partition("/")
    place = folder / package / kind
    if not place.is_dir():
        place.mkdir(parents=True)
        (folder / package / "__init__.py").touch()
        (place / "__init__.py").write_text(_LAZY_PACKAGE)
    (place / f"_{short}.py").write_text("\n".join(lines) + "\n")
