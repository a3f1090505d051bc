"""Serialises messages of ROS 1 with genpy: a program of its own, as genpy belongs to the system's Python.

It uses nothing but genpy and the standard library. Requests come on the standard input as pickles of (type, joint
text of all definitions, values), answers go to the standard output as pickles of (True, payloads) or (False, reason).
The first answer is genpy's version. It ends when its input does.
"""

import io
import os
import pickle
import sys
from importlib import metadata


def main() -> int:
    """Serve until the input ends; 1 if genpy is not installed."""
    try:
        import genpy
        import genpy.dynamic
    except ImportError:
        return 1
    # Whatever genpy prints must not come between the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _answer(answers, _version())
    while True:
        try:
            name, text, values = pickle.load(sys.stdin.buffer)
        except EOFError:
            return 0
        try:
            classes = genpy.dynamic.generate_dynamic(name, text)
            _answer(answers, (True, [_serialised(classes, name, value) for value in values]))
        except Exception as error:  # noqa: BLE001 - it refuses by exceptions of many types
            _answer(answers, (False, f"{type(error).__name__}: {error}"))


def _version():  # type: ignore[no-untyped-def]  # noqa: ANN202 - genpy has no types
    try:
        return metadata.version("genpy")
    except metadata.PackageNotFoundError:
        return "of unknown version"


def _answer(stream, answer):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202 - genpy has no types
    pickle.dump(answer, stream, protocol=4)
    stream.flush()


def _serialised(classes, name, value):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    buffer = io.BytesIO()
    _message(classes, name, value).serialize(buffer)
    return buffer.getvalue()


def _message(classes, name, value):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    message = classes[name]()
    for slot, type_ in zip(message.__slots__, message._slot_types):  # noqa: B905 - for any Python 3
        # A field whose name is a word of Python has a `_` behind it.
        member = value[slot] if slot in value else value[slot[:-1]]
        setattr(message, slot, _argument(classes, type_, member))
    return message


def _argument(classes, type_, value):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    import genpy

    element, is_array, _ = type_.partition("[")
    if is_array:
        return value if isinstance(value, bytes) else [_argument(classes, element, item) for item in value]
    if element in ("time", "duration"):
        time = genpy.Time() if element == "time" else genpy.Duration()
        # The constructor would carry what is above a second.
        time.secs, time.nsecs = value["sec"], value["nsec"]
        return time
    return _message(classes, element, value) if element in classes else value


if __name__ == "__main__":
    sys.exit(main())
