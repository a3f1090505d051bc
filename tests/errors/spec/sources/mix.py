"""Functions that do not fit their accelerators."""

from sources.helper import imported


def mix(message0, message1, message2):
    return message0


def keyword_only(message, *, gain):
    return message


if True:
    def twice(message, gain=2, *more):
        return message


def silent(message):
    {"x": message.x}
