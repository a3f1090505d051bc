"""Bags that are cut off, or in which a byte is wrong: never fewer messages without a fault.

python -m tests.storage.test_damage 4000 --seed 3     # damages each form at 4,000 places, and prints what was found
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from random import Random

import pytest

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.excerpt import Recording
from fusesoc_firm.runs.simulation.stimuli import read_stimuli
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.text.diagnostics import InputError
from tests.seeds import seeded
from tests.storage.forms import FORMS, TOPICS, items, version_of

# Forms in which something states the number of messages of each topic.
DAMAGED = (
    "mcap-ZSTD",
    "mcap-ZSTD-no-crc",
    "mcap-NONE-no-crc",
    "mcap-LZ4-chunk-index",
    "mcap-no-chunks",
    "mcap-no-chunks-no-crc",
    "rosbags-MCAP-9-NONE",
    "rosbags-MCAP-9-FILE",
    "rosbags-SQLITE3-9-NONE",
    "rosbags-SQLITE3-9-MESSAGE",
    "sqlite-4-split",
    "rosbags-ros1",
    "rosbags-ros1-LZ4",
    "ros1-old-headers",
)
_COUNT = 30
# The places in each form that the test damages.
_PLACES = 20


@pytest.mark.parametrize("name", DAMAGED)
def test_no_message_is_lost_in_silence(tmp_path: Path, name: str) -> None:
    """An exception other than `InputError` fails the test, too."""
    found = tried(tmp_path, name, _PLACES, seeded(38))
    assert found["lost"] == 0, found
    assert found["refused"] > 0


def tried(folder: Path, name: str, places: int, seed: int) -> Counter[str]:
    """Return how many damaged bags of a form were read whole, refused, and read with fewer messages."""
    random = Random(seed)
    whole = FORMS[name](folder, items(version_of(name), _COUNT))
    expected = numbers_in(whole, version_of(name))
    assert expected == [20, 10]
    files = sorted(whole.iterdir()) if whole.is_dir() else [whole]
    results: Counter[str] = Counter()
    for number in range(places):
        file = random.choice(files)
        good = file.read_bytes()
        damaged = damage(good, random)
        file.write_bytes(damaged)
        result = _result(whole, version_of(name), expected)
        results[result] += 1
        if result == "lost":
            shutil.copy(file, Path(tempfile.gettempdir(), f"lost-{name}-{seed}-{number}{file.suffix}"))
        file.write_bytes(good)
    return results


def damage(good: bytes, random: Random) -> bytes:
    """Return a file that is cut off, or in which one byte is wrong."""
    place = random.randrange(len(good))
    if random.random() < 0.25:
        return good[:place]
    bad = good[place] ^ (1 << random.randrange(8)) if random.random() < 0.5 else random.randrange(256)
    return good[:place] + bytes([bad]) + good[place + 1 :]


def _result(path: Path, version: int, expected: Sequence[int]) -> str:
    try:
        Recording.of(path)
        found = numbers_in(path, version)
    except InputError:
        return "refused"
    return "whole" if found == expected else "lost"


def numbers_in(path: Path, version: int) -> list[int]:
    """Return the numbers of messages that a system with a subscriber to each topic receives."""
    subscribers = _subscribers(version)
    found = Counter(item.subscriber.block for item in read_stimuli(path, subscribers))
    return [found[item.block] for item in subscribers]


@cache
def _subscribers(version: int) -> tuple[Topic, ...]:
    ros, name = ROS1 if version == 1 else ROS2, parse_name("geometry_msgs/Point")
    frame = frame_of(name, MessageLibrary(ros).closure(name))
    return tuple(Topic(topic.strip("/"), frame, given_name=topic) for topic in TOPICS)


def main() -> None:
    """Damage each form at many places."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("places", type=int)
    parser.add_argument("forms", nargs="*", default=DAMAGED)
    parser.add_argument("--seed", type=int, default=38)
    options = parser.parse_args()
    for name in options.forms:
        with tempfile.TemporaryDirectory() as folder:
            print(name, dict(tried(Path(folder), name, options.places, options.seed)), flush=True)


if __name__ == "__main__":
    main()
