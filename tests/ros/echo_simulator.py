"""The end of a simulator's pipe (docs/reference/transports.md) that sends every frame back at once, of any size."""

from __future__ import annotations


def number(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little")


def main() -> None:
    cycle = 0
    with open(3, "rb") as requests, open(4, "wb") as reports:
        reports.write(b"V" + number(5, 1))
        while (letter := requests.read(1)) not in (b"", b"Q"):
            size = int.from_bytes(requests.read(4), "little")
            if letter == b"R":
                cycle += size
                reports.write(b"S" + number(cycle, 8) + number(cycle, 4))
                reports.flush()
            else:
                frame = requests.read(size)
                beats = number(cycle, 8) + number(cycle + size, 8)
                reports.write(b"T" + beats + b"B" + frame[:1] + bytes(2) + beats + number(size, 4) + frame)
                cycle += size


if __name__ == "__main__":
    main()
