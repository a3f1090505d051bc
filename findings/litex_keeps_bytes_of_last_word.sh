#!/bin/sh
# Guess:    LiteX' `StrideConverter` from 8 to 32 bits marks 5 bytes as 4 bytes and 1 byte in `keep`.
# Really:   the last word keeps the data and the `keep` bits of the word before, except for the byte that came: 0xf
#           instead of 0x1. A receiver that trusts `keep` gets 8 bytes.
# Versions: LiteX 2024.12 with Migen 0.10.0
# Source:   `_UpConverter` in litex/soc/interconnect/stream.py writes only the part that arrives; `valid_token_count`
#           of its source has the right number, but the `StrideConverter` does not pass it on
# Met by:   users who connect a byte stream to an AXI stream of 32 bits
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install litex==2024.12 migen==0.10.0 setuptools==80.9.0

cat > simulate.py <<'PYTHON'
from importlib.metadata import version

from litex.soc.interconnect import stream
from migen import run_simulation

BYTES = [0x11, 0x22, 0x33, 0x44, 0x55]
converter = stream.StrideConverter([("data", 8), ("keep", 1)], [("data", 32), ("keep", 4)])
seen = []


def send():
    for number, value in enumerate(BYTES):
        yield converter.sink.data.eq(value)
        yield converter.sink.keep.eq(1)
        yield converter.sink.last.eq(number == len(BYTES) - 1)
        yield converter.sink.valid.eq(1)
        yield
        while not (yield converter.sink.ready):
            yield
    yield converter.sink.valid.eq(0)


def receive():
    yield converter.source.ready.eq(1)
    for _ in range(20):
        yield
        if (yield converter.source.valid):
            word = [(yield converter.source.data), (yield converter.source.keep), (yield converter.source.last)]
            seen.append("data {:08x} keep {:x} last {}".format(*word))


run_simulation(converter, [send(), receive()])
print("litex", version("litex"), "migen", version("migen"))
print("guess: data 44332211 keep f last 0; data ......55 keep 1 last 1")
print("seen: ", "; ".join(seen))
raise SystemExit(seen != ["data 44332211 keep f last 0", "data 44332255 keep f last 1"])
PYTHON
env/bin/python simulate.py
