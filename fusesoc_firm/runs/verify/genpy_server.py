"""Serialise ROS 1 messages with genpy, in a separate program because genpy belongs to the system's Python.

The program uses only genpy, genpy's parser genmsg and the standard library. Requests arrive on standard input as
pickles of (type, text of each definition, values). Results go to standard output as pickles of (True, payloads) or
(False, reason). The first result is genpy's version. The program ends when its input ends.

`genpy.dynamic.generate_dynamic` would create the classes of all nested messages, which takes seven times as long. The
outermost class alone serialises the whole message, so only this class is created; the values of nested messages are
plain objects.
"""
# mypy: ignore-errors
# ruff: noqa: ANN001, ANN202 - genpy has no types, and no other module may be imported here

import io
import os
import pickle
import sys
from importlib import metadata
from types import SimpleNamespace


def main() -> int:
    """Serve requests until the input ends; return the exit status, which is 1 if genpy is not installed."""
    try:
        import genpy.generator  # noqa: F401
    except ImportError:
        return 1
    # Keep genpy's own output out of the results.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _answer(answers, _version())
    while True:
        try:
            name, texts, values = pickle.load(sys.stdin.buffer)
        except EOFError:
            return 0
        try:
            _answer(answers, (True, _payloads(name, texts, values)))
        except Exception as error:  # noqa: BLE001 - genpy rejects messages with exceptions of many types
            _answer(answers, (False, f"{type(error).__name__}: {error}"))


def _version():
    try:
        return metadata.version("genpy")
    except metadata.PackageNotFoundError:
        return "of unknown version"


def _answer(stream, answer):
    pickle.dump(answer, stream, protocol=4)
    stream.flush()


def _payloads(name, texts, values):
    from genmsg.msg_loader import MsgContext, load_msg_from_string

    context = MsgContext.create_default()
    for each, text in texts.items():
        context.register(each, load_msg_from_string(context, text, each))
    made = _class_of(context, name)
    return [_payload(context, made, name, value) for value in values]


def _class_of(context, name):
    from genpy.generator import msg_generator

    spec = context.get_registered(name)
    lines = msg_generator(context, spec, {})
    # The classes of nested messages would be needed only for default values.
    text = "\n".join(line for line in lines if not (line.startswith("import ") and line.endswith(".msg")))
    scope = {}
    exec(text, scope)
    return scope[spec.short_name]


def _payload(context, made, name, value):
    buffer = io.BytesIO()
    _filled(context, made.__new__(made), name, value).serialize(buffer)
    return buffer.getvalue()


def _filled(context, message, name, value):
    from genpy.generator import make_python_safe

    spec = context.get_registered(name)
    for attribute, member, type_ in zip(make_python_safe(spec).names, spec.names, spec.types):  # noqa: B905 - Python 3.8
        setattr(message, attribute, _argument(context, type_, value[member]))
    return message


def _argument(context, type_, value):
    import genpy

    element, is_array, _ = type_.partition("[")
    if is_array:
        return value if isinstance(value, bytes) else [_argument(context, element, item) for item in value]
    if element in ("time", "duration"):
        time = genpy.Time() if element == "time" else genpy.Duration()
        # The constructor would normalise nanoseconds that exceed a second.
        time.secs, time.nsecs = value["sec"], value["nsec"]
        return time
    return _filled(context, SimpleNamespace(), element, value) if context.is_registered(element) else value


if __name__ == "__main__":
    sys.exit(main())
