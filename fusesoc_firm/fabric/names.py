"""The names with which the hardware finds the endpoints of peers that match those of a node (`firm_rtps_endpoint`).

The memory has 256 places each for topics, types and hashes. A place has a byte for each endpoint, the first one in the
lowest bits. Topics and types are strings as on the wire, little-endian. A hash has the form in an endpoint's user data.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint
from fusesoc_firm.text.render import Rendering

_PLACES = 256
LONGEST_NAME = _PLACES - len(rtps.string(""))
"""The characters of the longest name of a topic or type."""
_WORDS_IN_ROW = 8
_PARTS: tuple[Callable[[Endpoint], bytes], ...] = (
    lambda item: rtps.string(item.topic),
    lambda item: rtps.string(item.type),
    lambda item: f"typehash={item.hash};".encode(),
)


def names(endpoints: Sequence[Endpoint]) -> list[bytes]:
    """Return the words of the memory, the last endpoint's byte first. Raises ValueError if a name is too long."""
    words: list[bytes] = []
    for part in _PARTS:
        texts = [part(item) for item in reversed(endpoints)]
        longest = max(texts, key=len)
        if len(longest) > _PLACES:
            raise ValueError(f"{longest!r} has {len(longest)} bytes; at most {_PLACES} are compared")
        words += map(bytes, zip(*(text.ljust(_PLACES, b"\0") for text in texts), strict=True))
    return words


def memory_of_names(endpoints: Sequence[Endpoint], entity: str) -> Rendering:
    """Return the memory of the names of endpoints, as an entity for `firm_rtps_endpoint`."""
    words = [f'x"{word.hex()}"' for word in names(endpoints)]
    return Rendering(
        "vhdl/names.vhd",
        {
            "entity": entity,
            "endpoints": [{"number": number, "topic": item.topic} for number, item in enumerate(endpoints)],
            "bits": 8 * len(endpoints),
            "word_count": len(words),
            "rows": [", ".join(words[at : at + _WORDS_IN_ROW]) for at in range(0, len(words), _WORDS_IN_ROW)],
        },
    )
