"""The power stage of a drive over SDO: read its state, switch its mode, energise it, wait for what it reports.

Every command is followed by reading the state back. Nothing here resets a fault on the way to anything else.
"""

from collections.abc import Callable

from drivers.canopen import cia402
from drivers.canopen.emergency import code_text
from drivers.canopen.errors import SdoAbortError
from drivers.canopen.link import Link
from drivers.canopen.node import CanopenNode
from drivers.canopen.objects import (
    CONTROL_WORD,
    ERROR_CODE,
    MODE,
    MODE_DISPLAY,
    POSITION,
    STATUS_WORD,
    SUPPORTED_MODES,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
)
from drivers.canopen.options import DriveOptions
from drivers.clock import Clock
from drivers.errors import DriveFaultError, RigTimeoutError
from drivers.types import DriveState, Mode

POLL_TIME = 0.001
"""s between two looks at a state that is awaited."""
MOST_STEPS = 8
"""Changes of state on the way to operation enabled; the longest regular way takes four."""


class PowerStage:
    """State and mode of one drive. Every method may raise what object access raises (see `ObjectAccess`).

    No heartbeat of the bench is sent while a drive is being enabled, so each wait on that way ends after half of
    `watchdog_time` (s), whatever the options allow: beyond it the drives would stop by themselves.
    """

    def __init__(
        self, node: CanopenNode, options: DriveOptions, link: Link, clock: Clock, watchdog_time: float
    ) -> None:
        self._node = node
        self._name = node.name
        self._objects = node.objects
        self._options = options
        self._link = link
        self._clock = clock
        self._enable_timeout = min(options.state_timeout, watchdog_time / 2)
        self._mode_timeout = min(options.mode_timeout, watchdog_time / 2)

    def state(self) -> DriveState:
        """Read the state. Raises DriveFaultError if the status word is none of CiA 402."""
        return self._decode(self._objects.read(STATUS_WORD))

    def command(self, control_word: int, accept: Callable[[DriveState], bool], wanted: str) -> DriveState:
        """Write a control word and wait until the state is accepted; give it.

        Raises RigTimeoutError, with state and bits, if `wanted` does not come.
        """
        self._objects.write(CONTROL_WORD, control_word)
        return self._await(accept, wanted, self._options.state_timeout)

    def disable_voltage(self) -> DriveState:
        """Take the torque away; give the state read back."""
        return self.command(cia402.DISABLE_VOLTAGE, lambda state: not state.energised, "a state without torque")

    def clear_targets(self) -> None:
        """Make sure that no old setpoint acts: no torque, no speed, and the position where it stands."""
        self._objects.write_verified(TARGET_TORQUE, 0)
        self._objects.write_verified(TARGET_VELOCITY, 0)
        self._hold_position()

    def switch_mode(self, mode: Mode) -> None:
        """Write 0x6060 and wait until 0x6061 shows it. Raises DriveFaultError if the drive refuses, aloud or not."""
        code = cia402.MODE_CODES[mode]
        try:
            self._objects.write(MODE, code)
        except SdoAbortError as error:
            raise self._refused(mode, str(error)) from error
        deadline = self._clock.now() + self._mode_timeout
        while (shown := self._objects.read(MODE_DISPLAY)) != code:
            if self._clock.now() >= deadline:
                still = f"{MODE_DISPLAY} still shows {shown} after {self._mode_timeout:g} s"
                raise self._refused(mode, still)
            self._link.wait(POLL_TIME)

    def energise(self, mode: Mode) -> None:
        """Walk to operation enabled one transition at a time. Raises DriveFaultError, RigTimeoutError."""
        for _ in range(MOST_STEPS):
            state = self.state()
            if state is DriveState.ENABLED:
                return
            if state is DriveState.FAULT:
                raise self.fault_error("went into fault while it was being enabled", state)
            self._take_step(state, mode)
        raise self.fault_error(f"does not reach {DriveState.ENABLED}", self.state())

    def reset_fault(self) -> DriveState:
        """Give the rising edge of bit 7 and wait for switch-on disabled. Raises DriveFaultError if it stays."""
        self._objects.write(CONTROL_WORD, cia402.DISABLE_VOLTAGE)
        try:
            return self.command(
                cia402.FAULT_RESET,
                lambda state: state is DriveState.SWITCH_ON_DISABLED,
                str(DriveState.SWITCH_ON_DISABLED),
            )
        except RigTimeoutError as error:
            raise self.fault_error("stays in fault after a reset", self.state()) from error

    def fault_text(self) -> str:
        """Read and name the drive's error code, with its last emergency message."""
        code = self._objects.find(ERROR_CODE) or 0
        told = self._node.emergency
        return f"error code 0x{code:04X} ({code_text(code)})" + (f", {told.text}" if told is not None else "")

    def fault_error(self, what: str, state: DriveState) -> DriveFaultError:
        """Make the error that names error code and emergency message."""
        told = self._node.emergency
        return DriveFaultError(
            self._name,
            f"{what}: {self.fault_text()}",
            state=str(state),
            error_code=self._objects.find(ERROR_CODE) or (told.code if told is not None else 0),
            error_register=told.register if told is not None else 0,
            hint="Remove the cause, then reset the fault.",
        )

    def _take_step(self, state: DriveState, mode: Mode) -> None:
        step = cia402.step_to_enabled(state)
        if step is None:
            self._await(lambda new: new is not state, f"another state than {state}", self._enable_timeout)
            return
        if step.leads_to is DriveState.ENABLED and mode is Mode.POSITION:
            self._hold_position()
        self._objects.write(CONTROL_WORD, step.control_word)
        arrived = (step.leads_to, DriveState.FAULT, DriveState.FAULT_REACTION)
        self._await(lambda new: new in arrived, str(step.leads_to), self._enable_timeout)

    def _hold_position(self) -> None:
        self._objects.write_verified(TARGET_POSITION, self._objects.read(POSITION))

    def _await(self, accept: Callable[[DriveState], bool], wanted: str, timeout: float) -> DriveState:
        deadline = self._clock.now() + timeout
        while True:
            word = self._objects.read(STATUS_WORD)
            state = self._decode(word)
            if accept(state):
                return state
            if self._clock.now() >= deadline:
                raise RigTimeoutError(
                    f"drive '{self._name}' to reach {wanted}",
                    timeout,
                    last_seen=cia402.describe_status(word),
                    hint="Check supply, enable input and safe-torque-off of the drive.",
                )
            self._link.wait(POLL_TIME)

    def _decode(self, word: int) -> DriveState:
        try:
            return cia402.decode_state(word)
        except ValueError as error:
            raise DriveFaultError(self._name, f"reports an impossible state: {error}") from error

    def _refused(self, mode: Mode, how: str) -> DriveFaultError:
        supported = self._objects.find(SUPPORTED_MODES)
        listed = cia402.describe_modes(supported) if supported is not None else "not told by the drive"
        return DriveFaultError(
            self._name,
            f"refused mode {mode} (0x6060 = {cia402.MODE_CODES[mode]}): {how.rstrip('.')}; supported modes: {listed}",
            state=str(self.state()),
            hint="Use a mode that the drive supports, or set it up for cyclic synchronous operation.",
        )
