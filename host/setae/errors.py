"""Every error that setae raises on purpose.

All of them derive from `SetaeError`. A message says what was wrong, then what
to do about it; both parts are also attributes::

    SetaeError
    ├── ConfigError (ValueError)
    ├── InputError (ValueError)
    │   └── UnreachableError
    ├── TrajectoryError (ValueError)
    ├── LinkError
    │   ├── PortNotFoundError
    │   ├── PortBusyError
    │   ├── BoardSilentError (TimeoutError)
    │   ├── ProtocolMismatchError
    │   ├── LinkLostError
    │   └── BoardResetError
    ├── RefusedError
    ├── FaultError
    ├── StoppedError
    ├── TrippedError
    ├── PoseUnknownError
    ├── DeadlineError (TimeoutError)
    ├── StageError
    │   ├── ArmUnreachableError
    │   ├── ArmModeError
    │   ├── ArmRemoteError
    │   ├── ArmSafetyError
    │   ├── ArmFrozenError
    │   ├── ArmStoppedError
    │   └── ArmBoxError
    ├── HeightWindowError
    ├── SimulatorMissingError
    ├── LogError
    └── ExtraMissingError
"""

from __future__ import annotations

from typing import ClassVar

__all__ = [
    "ArmBoxError",
    "ArmFrozenError",
    "ArmModeError",
    "ArmRemoteError",
    "ArmSafetyError",
    "ArmStoppedError",
    "ArmUnreachableError",
    "BoardResetError",
    "BoardSilentError",
    "ConfigError",
    "DeadlineError",
    "ExtraMissingError",
    "FaultError",
    "HeightWindowError",
    "InputError",
    "LinkError",
    "LinkLostError",
    "LogError",
    "PortBusyError",
    "PortNotFoundError",
    "PoseUnknownError",
    "ProtocolMismatchError",
    "RefusedError",
    "SetaeError",
    "SimulatorMissingError",
    "StageError",
    "StoppedError",
    "TrajectoryError",
    "TrippedError",
    "UnreachableError",
]


class SetaeError(Exception):
    """Root of all errors of this package.

    Catch it to handle whatever setae raises on purpose; anything else that
    escapes is a bug.

    Parameters
    ----------
    problem
        What was wrong, as a sentence.
    remedy
        What to do about it, as a sentence. Empty: the class's own.

    Attributes
    ----------
    problem, remedy : str
        The two parts of the message.

    Examples
    --------
    >>> print(SetaeError("The robot is cold.", "Warm it up."))
    The robot is cold. Warm it up.
    """

    default_remedy: ClassVar[str] = ""

    def __init__(self, problem: str, remedy: str = "") -> None:
        super().__init__(problem, remedy)
        self.problem = problem
        self.remedy = remedy or self.default_remedy

    def __str__(self) -> str:
        return f"{self.problem} {self.remedy}".strip()


class ConfigError(SetaeError, ValueError):
    """A configuration can't be used.

    Examples of when it happens: the file is missing or isn't TOML, a key is
    misspelled, a value has the wrong type or lies outside its range.

    What to do: the message names the file, the key with its unit, and the range.
    """


class InputError(SetaeError, ValueError):
    """A value passed to a function means nothing to it.

    Examples of when it happens: NaN or infinity in a position, an array whose
    last axis doesn't have three entries, z ≤ 0.

    What to do: the message names the argument, and the place of the first bad
    value in an array.
    """


class UnreachableError(InputError):
    """A well-formed target that this robot can't take.

    Examples of when it happens: the backbone would be longer than the free
    spring, a tendon longer or shorter than its servo can give.

    What to do: choose a target inside the workspace; `setae.workspace.check`
    says why one lies outside.
    """


class TrajectoryError(SetaeError, ValueError):
    """A motion can't be planned as asked.

    Examples of when it happens: the duration is too short for the servos, or
    the tendon model jumps along the path.

    What to do: give it more time, or use the model ``parallel``, or a straight
    line between tendon lengths.
    """


class LinkError(SetaeError):
    """The connection to the board doesn't work; see the subclasses."""


class PortNotFoundError(LinkError):
    """No serial port with that name, or no board on any port.

    Examples of when it happens: the cable is out, the name is misspelled, the
    board came back under another name.
    """

    default_remedy = "Check the cable, then run `setae ports` to see what is there."


class PortBusyError(LinkError):
    """The serial port exists but can't be opened.

    Examples of when it happens: another program holds it, ModemManager probes
    it, or the user isn't in the group that may open it.
    """

    default_remedy = (
        "Close the other program (a serial monitor?); on Linux check that you are in the group "
        "that owns the port, usually `dialout`."
    )


class BoardSilentError(LinkError, TimeoutError):
    """The port is open, but the board doesn't answer the handshake.

    Examples of when it happens: the board holds other firmware, or none.
    """

    default_remedy = "Flash the firmware with `setae flash`, then try again."


class ProtocolMismatchError(LinkError):
    """Host and board speak different versions of the protocol.

    Examples of when it happens: setae was updated, and the board or the compiled
    simulator wasn't.
    """

    default_remedy = (
        "Flash the firmware of this version with `setae flash`; a simulator of another version is "
        "compiled anew by `make build`."
    )


class LinkLostError(LinkError):
    """The board stopped answering in the middle of a session.

    Examples of when it happens: the cable was pulled, the board lost its supply.

    The board plays what it has queued, then holds; it doesn't need the host to
    be safe.
    """

    default_remedy = "Check the cable and the supply, then connect again."


class BoardResetError(LinkError):
    """The board started anew in the middle of a session, so the session is over.

    Examples of when it happens: another program opened the port (which resets
    an UNO), the supply broke down, the watchdog acted.

    Motion never goes on by itself.
    """

    default_remedy = "Find out what reset it, then connect again and enable."


class RefusedError(SetaeError):
    """The board received a command and didn't carry it out.

    Examples of when it happens: the target breaks a limit of the board, the
    servos aren't enabled, the board is stopped.

    Parameters
    ----------
    reason
        The board's reason, by its name in the protocol, such as ``pair_limit``.
    remedy
        What to do.
    command
        The refused command's name.
    detail
        The reason in words, with figures.
    """

    def __init__(
        self, reason: str, remedy: str = "", *, command: str = "the command", detail: str = ""
    ) -> None:
        problem = f"The board refused {command} ({reason})"
        super().__init__(f"{problem}: {detail}" if detail else f"{problem}.", remedy)
        self.reason = reason
        self.command = command
        self.detail = detail

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild_refused, (type(self), self.reason, self.remedy, self.command, self.detail)


def _rebuild_refused(
    kind: type[RefusedError], reason: str, remedy: str, command: str, detail: str
) -> RefusedError:
    return kind(reason, remedy, command=command, detail=detail)


class FaultError(SetaeError):
    """The board found something broken and froze the servos.

    Examples of when it happens: the pressure sensor fell silent while a guard
    was armed, the supply is too low.

    Parameters
    ----------
    fault
        The fault by its name in the protocol, such as ``sensor_silent``.
    remedy
        What to do.
    detail
        The fault in words, with figures.
    """

    def __init__(self, fault: str, remedy: str = "", *, detail: str = "") -> None:
        problem = f"The board is in fault ({fault})"
        super().__init__(f"{problem}: {detail}" if detail else f"{problem}.", remedy)
        self.fault = fault
        self.detail = detail

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild_fault, (type(self), self.fault, self.remedy, self.detail)


def _rebuild_fault(kind: type[FaultError], fault: str, remedy: str, detail: str) -> FaultError:
    return kind(fault, remedy, detail=detail)


class StoppedError(SetaeError):
    """A stop ended the motion.

    Examples of when it happens: `stop()` from another place, Ctrl-C in the
    command line.
    """

    default_remedy = "Once the robot may move again, call resume(), or give `setae enable`."


class TrippedError(SetaeError):
    """The bristle touched something where no contact was expected.

    Examples of when it happens: an unguarded move ran into an obstacle and
    crossed the coarse threshold.
    """

    default_remedy = "Make room, then call resume(), or give `setae enable`."


class PoseUnknownError(SetaeError):
    """Nobody knows where the servos are, and the first pulse would jump.

    Examples of when it happens: the first enable() after the board was powered.
    The jump can release up to 50 mm of tendon at full speed.
    """

    default_remedy = (
        "Let the spring relax, keep clear, then give --accept-jump, or call "
        "enable(accept_jump=True)."
    )


class DeadlineError(SetaeError, TimeoutError):
    """Something didn't happen in time, though the link works.

    Examples of when it happens: a move didn't end within its time limit.
    """


class StageError(SetaeError):
    """The robot arm that carries setae doesn't do as told.

    Examples of when it happens: its controller froze, is in protective stop, or
    isn't in remote mode.
    """


class ArmUnreachableError(StageError):
    """Nothing that is a UR controller answers at the address.

    Examples of when it happens: the controller is off, the cable or the address is
    wrong, a firewall stands between.
    """

    default_remedy = "Check the address, the cable and that the controller is on: `ping` it."


class ArmModeError(StageError):
    """The arm can't move: it is not powered, or its brakes are on.

    Examples of when it happens: nobody has pressed ON and START on the pendant yet.
    """

    default_remedy = "Switch the arm on with the pendant (ON, then START), and try again."


class ArmRemoteError(StageError):
    """The controller does not take commands from outside.

    Examples of when it happens: the pendant's mode is Local.
    """

    default_remedy = (
        "Enable remote control in the pendant's settings (System, Remote Control), then choose"
        " Remote at its top right."
    )


class ArmSafetyError(StageError):
    """The arm's safety system has stopped it.

    Examples of when it happens: a protective stop after a collision, an emergency
    stop, an open safeguard.
    """

    default_remedy = (
        "Look at what the pendant says, make the place safe, then release the stop there. The"
        " robot stays stopped; start the run again."
    )


class ArmFrozenError(StageError):
    """The controller has stopped telling where the arm is, or takes no commands.

    Examples of when it happens: the controller crashed, the network broke, the process that
    talks to it was killed.
    """

    default_remedy = (
        "Nobody knows whether the arm still moves: use the emergency stop if it does. Then look"
        " at the pendant and the network."
    )


class ArmStoppedError(StageError):
    """The arm takes no moves any more, or did not get to where it was sent.

    Examples of when it happens: someone pressed Stop or Pause on the pendant, also while the
    arm rested, or set the speed slider to zero; the host did not look after a moving arm, and
    the controller's watchdog stopped it.
    """

    default_remedy = "Look at the pendant; then start the run again."


class ArmBoxError(StageError):
    """A target lies outside the box in which the arm may carry the robot.

    Examples of when it happens: the start is lower than thought.
    """

    default_remedy = "Start elsewhere, or change box_min_mm and box_max_mm in [ur]."


class HeightWindowError(SetaeError):
    """What is scanned does not fit between the retracted and the extended bristle.

    Examples of when it happens: the object is taller than `tallest_mm` says, or the arm's start
    is too low.
    """


class SimulatorMissingError(SetaeError):
    """The compiled simulator isn't part of this installation.

    Examples of when it happens: the package was built without a C++ compiler.
    """

    default_remedy = "Install a C++ compiler (Debian: g++, cmake) and install setae again."


class LogError(SetaeError):
    """A log can't be read or written.

    Examples of when it happens: the file isn't MCAP, or not one of setae's; the
    disk is full.
    """


class ExtraMissingError(SetaeError):
    """A part of setae needs packages that aren't installed.

    Parameters
    ----------
    extra
        The extra that brings them, such as ``ur``.
    what
        What needs them.

    Examples
    --------
    >>> print(ExtraMissingError("ur", "A UR arm"))
    A UR arm needs packages that aren't installed. Run: pip install 'setae[ur]'
    """

    def __init__(self, extra: str, what: str = "This") -> None:
        super().__init__(
            f"{what} needs packages that aren't installed.", f"Run: pip install 'setae[{extra}]'"
        )
        self.extra = extra
        self.what = what

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.extra, self.what)
