"""Open a transport by its address, as given on a command line or in a launch file (docs/reference/transports.md).

pipe:COMMAND                      a simulator
uart:DEVICE:BAUD[:rtscts]         a serial line, with flow control by wires
dma:UIO:BUFFER[:poll]             AXI DMA, such as dma:/dev/uio0:udmabuf0, without its interrupt
"""

from __future__ import annotations

import os
from collections.abc import Callable

from fusesoc_firm.node.transport.dma import DmaTransport
from fusesoc_firm.node.transport.dma_device import LinuxDmaDevice
from fusesoc_firm.node.transport.simulator import Event, Pace, Simulator, SimulatorTransport
from fusesoc_firm.node.transport.transport import Transport, TransportError
from fusesoc_firm.node.transport.uart import UartTransport

LEGAL = "pipe:COMMAND, uart:DEVICE:BAUD[:rtscts], dma:UIO:BUFFER[:poll]"


def open_transport(
    address: str,
    pace: Pace | None = None,
    observe: Callable[[Event], None] | None = None,
    wants_waits: Callable[[], bool] = lambda: False,
) -> Transport:
    """Open the transport at an address; the other arguments are for a simulator. May raise `TransportError`.

    The shell runs a simulator's command.
    """
    kind, _, rest = address.partition(":")
    if kind == "pipe" and rest.strip():
        command = ["/bin/sh", "-c", rest]
        return SimulatorTransport(lambda: Simulator(command), pace, observe, wants_waits)
    if kind == "uart":
        device, second, has_flow_control = _device(rest, ":rtscts")
        if device and second:
            return UartTransport(device, _baud(second), has_flow_control=has_flow_control)
    if kind == "dma":
        uio, buffer, is_polled = _device(rest, ":poll")
        if uio and buffer:
            return DmaTransport(LinuxDmaDevice(uio, buffer, has_interrupt=not is_polled))
    raise TransportError(f"the transport is '{address}'; legal: {LEGAL}")


def device_of(address: str) -> str:
    """Return the kind and the device of an address, such as `uart:/dev/ttyUSB1`, or "" without a device.

    Two addresses of the same device have the same result.
    """
    kind, _, rest = address.partition(":")
    options = {"uart": ":rtscts", "dma": ":poll"}
    device = _device(rest, options[kind])[0] if kind in options else ""
    return f"{kind}:{os.path.realpath(device)}" if device else ""


def _device(text: str, option: str) -> tuple[str, str, bool]:
    """Split `FIRST:SECOND` and an optional `:option` from the end, since device names may contain colons."""
    has_option = text.endswith(option)
    first, _, second = text.removesuffix(option).rpartition(":")
    return first, second, has_option


def _baud(text: str) -> int:
    if not text.isdecimal() or len(text) > 9:
        raise TransportError(f"the baud rate is '{text}', which is not a number")
    return int(text)
