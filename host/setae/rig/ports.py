"""Serial ports, and which of them is the board's."""

from __future__ import annotations

from dataclasses import dataclass

from serial.tools import list_ports

from setae.errors import PortNotFoundError

__all__ = ["PortInfo", "find_port", "ports"]

# USB vendor and product of a UNO, its clones (CH340) and FTDI's adapters.
_USB_IDS = {
    (0x2341, 0x0043), (0x2341, 0x0001), (0x2341, 0x0243), (0x2A03, 0x0043),
    (0x1A86, 0x7523), (0x0403, 0x6001),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class PortInfo:
    """A serial port of this computer.

    Attributes
    ----------
    device
        Its name, such as /dev/ttyACM0.
    description
        What the system says of it.
    likely
        Whether its USB ids are those of a UNO or of a usual clone.
    """

    device: str
    description: str
    likely: bool


def ports() -> list[PortInfo]:
    """List the serial ports, by name."""
    return sorted(
        (
            PortInfo(
                device=port.device,
                description=port.description or "",
                likely=(port.vid, port.pid) in _USB_IDS,
            )
            for port in list_ports.comports()
        ),
        key=lambda port: port.device,
    )


def find_port() -> str:
    """Find the one port with a board.

    Raises
    ------
    PortNotFoundError
        There is none, or more than one; the message lists the ports.
    """
    there = ports()
    likely = [port.device for port in there if port.likely]
    if len(likely) == 1:
        return likely[0]
    if likely:
        raise PortNotFoundError(
            f"{len(likely)} ports may hold the board: {', '.join(likely)}.",
            "Choose one with --port, or connect(port).",
        )
    others = ", ".join(port.device for port in there) or "none at all"
    raise PortNotFoundError(
        f"No port has the USB ids of a UNO; ports here: {others}.",
        "Plug the board in, name its port with --port, or use the simulator: --sim.",
    )
