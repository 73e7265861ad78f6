"""Carry out a procedure on a bench, one control cycle at a time, and leave the bench safe whatever happens.

Every cycle: wait for its deadline, exchange with the devices, log the sample, check the limits, give the sample to
the procedure, queue the setpoints it asks for. The safe state is reached in one place, the `finally` of `execute`;
it is confirmed by reading the drives' states back, and recorded.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from drivers.errors import (
    AbortedError,
    ConfigError,
    CycleError,
    DriveFaultError,
    LimitError,
    Mistake,
    NotConnectedError,
    ReadingError,
    RigError,
)
from drivers.types import Axis, DeviceEvent, DriveState, Mode, Sample, Setpoint
from procedures.intents import Ask, Command, Evaluation, Intent, Mark, Result, SetLock, Steps, Tare
from rig.bench import NO_ANSWER_HINT, Bench, SafeReport
from rig.config.bench import Reaction
from rig.frozen import CHECK_TIME, FrozenWatch
from rig.limits import LimitWatch
from rig.log.run import RunEvent
from rig.operator import Answered, Operator
from rig.stop import Stop

QUICK_STOP_TIME = 0.5
"""How long to wait, s, for the end of the drives' own quick-stop ramps: 220 rad/s at 440 rad/s^2."""

RUNAWAY = ("motor_velocity", "load_velocity", "motor_position", "load_position", "output_position")
"""Signals whose limit is broken by what moves on under a torque that is only slowly taken away."""

UNLOCK_SHARE = 0.05
"""Torque under which the output may be unlocked, as a share of its limit: above what a gear leaves wound up."""

LISTENING_TIME = 0.5
"""How long to listen, s, after the devices fell silent: longer than a drive takes to restart."""

REACTION = "Reaction: "
"""What the note begins with that tells how the bench was made safe."""

DISABLE = "disable"
"""Reaction where every axis is released or at zero, so that there is nothing to ramp or to stop."""

NOT_CONFIRMED = "not confirmed"
"""What stands for the state of a drive that did not answer, or never showed one without torque."""

_ENERGISED = tuple(str(state) for state in DriveState if state.energised)


class Status(StrEnum):
    """How a run ended."""

    DONE = "done"
    LIMIT = "limit"
    FAULT = "fault"
    ABORTED = "aborted"
    ERROR = "error"


class RunLog(Protocol):
    """What the runner writes to."""

    def write(self, sample: Sample) -> None:
        """Log one sample."""

    def event(self, event: RunEvent) -> None:
        """Log a phase, a limit, an operator's word."""

    def device_event(self, event: DeviceEvent) -> None:
        """Log what a device reported by itself."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a run stands: `time` s, the phase and its expected length (s), the latest sample."""

    time: float
    phase: str
    phase_duration: float | None
    sample: Sample


@dataclass(frozen=True, slots=True)
class SafeState:
    """How the bench was made safe: the reaction, each drive's state read back, and whether none carries torque."""

    reaction: str
    states: Mapping[str, str] = field(default_factory=dict)
    confirmed: bool = False
    problem: str = ""


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """How a run ended. `evaluate` computes its result, which may take longer than the drives wait for a heartbeat.

    `extremes`: largest magnitude of each signal seen, in its SI unit.
    """

    status: Status
    evaluate: Evaluation
    cycles: int
    late: int
    missing: int
    duration: float
    safe_state: SafeState
    extremes: Mapping[str, float]
    error: RigError | None = None


def execute(
    bench: Bench,
    steps: Steps,
    log: RunLog,
    operator: Operator,
    stop: Stop,
    on_progress: Callable[[Progress], None] | None = None,
) -> RunOutcome:
    """Run the procedure to its end, or to the first limit, fault or request to stop; then make the bench safe.

    A RigError ends the run and is carried in the outcome; any other exception is raised again after the safe state.
    """
    run = _Execution(bench, log, operator, stop, on_progress)
    error: RigError | None = None
    evaluate: Evaluation = Result
    try:
        evaluate = run.to_the_end(steps)
    except RigError as caught:
        error = caught
        run.say("error", str(caught))
    finally:
        safe, trouble = run.make_safe(error)
        steps.close()
    if error is None:
        error = trouble if safe.confirmed else _not_confirmed(safe)
    if isinstance(error, CycleError | NotConnectedError):
        run.listen_for_the_cause(error)
    return RunOutcome(
        status=_status(error),
        evaluate=evaluate,
        cycles=run.index,
        late=run.late,
        missing=run.missing,
        duration=run.time,
        safe_state=safe,
        extremes=run.watch.extremes,
        error=_with_safe_state(error, safe),
    )


def _status(error: RigError | None) -> Status:
    if error is None:
        return Status.DONE
    if isinstance(error, AbortedError):
        return Status.ABORTED
    if isinstance(error, LimitError):
        return Status.LIMIT
    return Status.FAULT if error.exit_code == RigError.exit_code else Status.ERROR


def _not_confirmed(safe: SafeState) -> DriveFaultError:
    """Make the error of a run that went as planned and left a drive that may carry torque."""
    doubtful = [axis for axis, state in safe.states.items() if state in (NOT_CONFIRMED, *_ENERGISED)]
    return DriveFaultError(
        ", ".join(doubtful),
        "did not confirm at the end of the run that it carries no torque",
        state=", ".join(safe.states[axis] for axis in doubtful),
        hint="Take the power away by the emergency stop before anyone touches the bench.",
    )


def _with_safe_state(error: RigError | None, safe: SafeState) -> RigError | None:
    if error is None:
        return None
    done = "the drives confirmed it" if safe.confirmed else "NOT CONFIRMED by the drives, check the bench"
    error.add_note(f"{REACTION}{safe.reaction}; {done}.")
    if safe.problem:
        error.add_note(safe.problem)
    if isinstance(error, LimitError):
        error.reaction, error.confirmed = safe.reaction, safe.confirmed
    if isinstance(error, AbortedError):
        error.confirmed = safe.confirmed
    error.facts |= {"reaction": safe.reaction, "confirmed": safe.confirmed}
    return error


class _Execution:
    """The state of one run in progress."""

    def __init__(
        self,
        bench: Bench,
        log: RunLog,
        operator: Operator,
        stop: Stop,
        on_progress: Callable[[Progress], None] | None,
    ) -> None:
        self._bench = bench
        self._clock = bench.clock
        self._limits = bench.config.limits.frozen()
        self.watch = LimitWatch(self._limits, bench.config.cycle_time)
        self._cycle_time = bench.config.cycle_time
        self._log = log
        self._operator = operator
        self._stop = stop
        self._on_progress = on_progress
        self._frozen = FrozenWatch(self._limits, bench.torque_resolutions)
        self._look_every = max(1, round(CHECK_TIME * bench.config.cycle_rate))
        self._progress_every = max(1, bench.config.cycle_rate // 5)
        self._begin = self._deadline = self._clock.now()
        self._phase = Mark("start")
        self._released = True
        self._heard: list[str] = []
        self._latest = Sample(0.0, 0)
        self._missing_now: tuple[str, ...] = ()
        self.index = 0
        self.late = 0
        self.missing = 0
        self.time = 0.0

    def say(self, kind: str, text: str) -> None:
        """Put an event into the log at the present time."""
        self._log.event(RunEvent(self.time, kind, text))

    def to_the_end(self, steps: Steps) -> Evaluation:
        """Drive the generator until it returns; give how its result is computed."""
        self._cycle()
        intent = next(steps)
        try:
            while True:
                if isinstance(intent, Command):
                    self._command(intent)
                    self._cycle()
                else:
                    self._carry_out(intent)
                intent = steps.send(self._latest)
        except StopIteration as end:
            evaluate: Evaluation = end.value
            return evaluate

    def _carry_out(self, intent: Intent) -> None:
        match intent:
            case Mark():
                self._phase = intent
                self.say("phase", intent.phase)
            case SetLock(locked):
                self._require_released("the output lock may only change")
                if not locked:
                    self._require_unloaded("it was not opened")
                self.say("operator", "lock the output" if locked else "release the output")
                self._wait_for(self._bench.set_lock(locked))
                if not locked:
                    self._require_unloaded("it did so when its lock was said to be open")
                self.watch.start_travel()
                self._reschedule()
            case Tare():
                self._require_released("the torque sensor may only be zeroed")
                self.say("tare", f"removed {self._bench.tare():.6g} N*m")
                self._reschedule()
            case Ask(text):
                self._require_released("the operator may only be asked")
                self.say("operator", text)
                self._wait_for(self._operator.ask(text))
            case Command():
                raise ValueError("a Command takes a cycle of its own")

    def _wait_for(self, answered: Answered) -> None:
        """Keep the cycle running, with both axes released, until the operator has answered."""
        while not answered():
            self._cycle()

    def _require_released(self, what: str) -> None:
        if not self._released:
            raise ConfigError(
                "procedure",
                [Mistake("intent", "axes energised", f"{what} at zero torque, with both drives released")],
            )

    def _require_unloaded(self, outcome: str) -> None:
        """Refuse to go on, after a fresh cycle, with an output that would fly off. Raises LimitError."""
        self._cycle()
        sample = self._latest
        torque, bound = sample.output_torque, UNLOCK_SHARE * self._limits.output_torque
        if torque is None or abs(torque) <= bound:
            return
        raise LimitError(
            "output_torque",
            torque,
            bound,
            "N*m",
            cycle=sample.cycle,
            what=f"The output carries {torque:.4g} N*m in cycle {sample.cycle}, and the lock opens under no more than "
            f"{bound:.4g} N*m ({UNLOCK_SHARE:.0%} of the limit output_torque); {outcome}.",
            hint="Take the load off, or turn the motor by hand until the torque is gone.",
        )

    def _reschedule(self) -> None:
        self._deadline = self._clock.now()

    def _command(self, command: Command) -> None:
        for axis, setpoint in ((Axis.MOTOR, command.motor), (Axis.LOAD, command.load)):
            if setpoint is not None:
                self.watch.check_setpoint(axis, setpoint, self.index)
                if setpoint.mode is Mode.POSITION:
                    self.watch.check_step(axis, setpoint.value, self._bench.setpoint(axis), self.index)
            elif self._bench.setpoint(axis) is None:
                continue
            if self._bench.apply(axis, setpoint):
                self.say("drive", f"{axis}: {setpoint.mode if setpoint is not None else 'released'}")
                self._reschedule()
        self._released = command.motor is None and command.load is None

    def _cycle(self) -> None:
        """Run one control cycle and log it; keep its sample, with the last known values where one was missing."""
        self._stop.check(self._phase.phase)
        if self.index:
            self._deadline += self._cycle_time
            self._clock.sleep_until(self._deadline)
        now = self._clock.now()
        due = self._deadline
        late = now > due + 0.5 * self._cycle_time
        if late:
            self.late += 1
            self._deadline = now
        self.time = now - self._begin if self.index else 0.0
        if not self.index:
            self._begin = now
        try:
            report = self._bench.cycle(self.time, self.index, late)
        finally:
            self._log_events(self._bench.events())
        self.missing += len(report.missing)
        self._missing_now = report.missing
        self._log.write(report.sample)
        self.index += 1
        self._latest = report.filled
        self.watch.observe(report.filled)
        self.watch.check(report.filled)
        if self.index % self._look_every == 0:
            self._frozen.look(report.filled, {axis: self._bench.setpoint(axis) for axis in Axis})
        if report.missing and self.missing > self._limits.missing_cycles:
            raise CycleError(
                f"No answer from {self._bench.located(report.missing)} at {self.time:.3f} s",
                late=self.late,
                missing=self.missing,
                worst_age=self._cycle_time,
                limit=self._limits.missing_cycles,
                hint=f"{NO_ANSWER_HINT} limits.missing_cycles allows for single losses.",
            )
        if late and self.late > self._limits.late_cycles:
            raise CycleError(
                f"Too many late cycles at {self.time:.3f} s",
                late=self.late,
                missing=self.missing,
                worst_age=now - due,
                limit=self._limits.late_cycles,
                hint="Close other programs, lower cycle_rate, or raise limits.late_cycles in the bench file.",
            )
        if self._on_progress is not None and self.index % self._progress_every == 0:
            self._on_progress(Progress(self.time, self._phase.phase, self._phase.duration, report.filled))

    def listen_for_the_cause(self, error: RigError) -> None:
        """Hear what the devices report after a failure (a restart, an emergency) and add it to the error.

        Nothing is sent meanwhile, so drives that were watched report that they miss the bench, too.
        """
        before = len(self._heard)
        for _ in range(round(LISTENING_TIME / self._cycle_time)):
            self._deadline += self._cycle_time
            self._clock.sleep_until(self._deadline)
            self.time = self._clock.now() - self._begin
            self._log_events(self._bench.listen())
        for when, heard in (
            ("The devices reported", self._heard[:before]),
            ("Later, left alone", self._heard[before:]),
        ):
            if heard:
                error.add_note(f"{when}: {'; '.join(heard)}.")

    def _log_events(self, events: list[DeviceEvent]) -> None:
        for event in events:
            self._log.device_event(event)
            self._heard.append(f"{event.device}: {event.text}")

    def make_safe(self, cause: RigError | None) -> tuple[SafeState, RigError | None]:
        """Take the torque away by the bench's declared reaction, confirm it, and record it. Raises nothing.

        The drives stop by themselves after a speed or travel limit, after a reading that cannot be true, where the ramp
        fails or breaks a limit, and where all that is driven follows a position, which has no ramp. A sensor or a log
        that fails changes nothing of that.
        Gives with it the first thing that went wrong on the way, whether or not the bench is safe now.
        """
        problems = _Problems(self._named(cause))
        taken: list[str] = []
        stop = True
        if self._bench.config.safety.reaction is Reaction.RAMP and not (_runs_away(cause) or self._lost_a_drive()):
            commanded = self._commanded()
            if any(value for mode, value in commanded.values() if mode is not Mode.POSITION):
                taken.append(Reaction.RAMP)
                stop = not problems.catch(lambda: self._ramp_down(commanded, cause, problems))
            elif not any(mode is Mode.POSITION for mode, _ in commanded.values()):
                taken.append(DISABLE)
                stop = False
        if stop:
            taken.append(Reaction.QUICK_STOP)
            problems.catch(lambda: self._stop_quickly(problems))
        states = self._take_torque(problems)
        confirmed = all(axis in states and not states[axis].energised for axis in self._bench.axes)
        told_already = None if cause is None else _told(cause)
        safe = SafeState(
            reaction=", ".join(taken),
            states={str(axis): str(states.get(axis, NOT_CONFIRMED)) for axis in self._bench.axes},
            confirmed=confirmed,
            problem=" ".join(text for text in dict.fromkeys(map(_told, problems.found)) if text != told_already),
        )
        shown = ", ".join(f"{axis} {state}" for axis, state in safe.states.items())
        text = f"{safe.reaction}: {shown}; {'confirmed' if confirmed else 'NOT CONFIRMED'}"
        problems.catch(lambda: self.say("safe state", text))
        problems.catch(lambda: self._log_events(self._bench.events()))
        return safe, _on_the_way(problems.found[0]) if problems.found else None

    def _named(self, cause: RigError | None) -> set[str]:
        """Give the devices that the cause of the end tells about already."""
        named = set(self._missing_now) if isinstance(cause, CycleError) else set()
        if isinstance(cause, NotConnectedError):
            named |= cause.missing.keys()
        if isinstance(cause, DriveFaultError):
            named.add(cause.device)
        if isinstance(cause, LimitError) and cause.signal == "output_torque":
            named.add("torque_sensor")
        return named

    def _lost_a_drive(self) -> bool:
        """Tell whether a drive that was told something carries no torque: nothing holds what another still pushes."""
        commanded = self._commanded()
        try:
            readings = self._bench.readings()
        except Exception:  # a drive whose reading makes no sense is no drive to rely on
            return bool(commanded)
        return any(axis in readings and not readings[axis].state.energised for axis in commanded)

    def _take_torque(self, problems: "_Problems") -> Mapping[Axis, DriveState]:
        """Disable every drive; where one fails, quick stop is the second way. Give the last state read of each."""
        tried = [self._bench.disable()]
        if tried[0].failure is not None:
            # the last one reads how the drives' own ramps ended
            tried += [self._bench.quick_stop(), self._bench.disable()]
        problems.found += [stopped.failure for stopped in tried if stopped.failure is not None]
        return {axis: state for stopped in tried for axis, state in stopped.states.items()}

    def _stop_quickly(self, problems: "_Problems") -> None:
        """Let every drive stop by its own ramp, and keep the control loop alive until these are over.

        A drive that does not obey does not take this time from the others.
        """
        failure = self._bench.quick_stop().failure
        if failure is not None:
            problems.found.append(failure)
        self._reschedule()
        end = self._clock.now() + QUICK_STOP_TIME
        while self._clock.now() < end and self._bench.energised:
            self._safe_cycle(problems)

    def _commanded(self) -> Mapping[Axis, Setpoint]:
        """Give what each axis that is not released was told."""
        return {axis: setpoint for axis in self._bench.axes if (setpoint := self._bench.setpoint(axis)) is not None}

    def _ramp_down(self, commanded: Mapping[Axis, Setpoint], cause: RigError | None, problems: "_Problems") -> None:
        """Ramp torque and speed of each energised axis to zero in the declared time; one in position mode holds.

        Raises LimitError if a limit is broken meanwhile; the one that was broken before may be a tenth higher. Raises
        what is wrong with a drive.
        """
        if isinstance(cause, LimitError):
            self.watch.tolerate(cause)
        readings = self._bench.readings()
        start = {
            axis: self._ramp_start(axis, setpoint, readings[axis].torque)
            for axis, setpoint in commanded.items()
            if readings[axis].state.energised
        }
        self._reschedule()
        cycles = max(1, round(self._bench.config.safety.ramp_time / self._cycle_time))
        for k in range(cycles, -1, -1):
            for axis, (mode, value) in start.items():
                setpoint = Setpoint(mode, value if mode is Mode.POSITION else value * k / cycles)
                self.watch.check_setpoint(axis, setpoint, self.index)
                self._bench.apply(axis, setpoint)
            report = self._safe_cycle(problems)
            for axis in self._bench.axes:
                if axis in report.troubles:
                    raise report.troubles[axis]
            self.watch.check(report.cycle.filled)

    def _ramp_start(self, axis: Axis, commanded: Setpoint, torque: float) -> Setpoint:
        """Give where the ramp of an axis begins: at what was commanded or at what is measured, the smaller one."""
        mode, value = commanded
        if mode is Mode.POSITION:
            return commanded
        measured = torque if mode is Mode.TORQUE else self.watch.speed(axis)
        if value * measured <= 0.0:
            return Setpoint(mode, 0.0)
        return Setpoint(mode, min(value, measured, key=abs))

    def _safe_cycle(self, problems: "_Problems") -> SafeReport:
        """Run and log one cycle on the way to the safe state.

        Neither a request to stop nor lateness ends it, nor a device or a log that fails: that is noted, once for each.
        """
        self._deadline += self._cycle_time
        self._clock.sleep_until(self._deadline)
        self.time = self._clock.now() - self._begin
        report = self._bench.safe_cycle(self.time, self.index)
        for place, trouble in report.troubles.items():
            problems.note(place, trouble)
        problems.catch(lambda: self._log.write(report.cycle.sample), "log")
        self.index += 1
        self.watch.observe(report.cycle.filled)
        return report


class _Problems:
    """What went wrong on the way to the safe state, in order; what a place goes on to say is kept once.

    `known`: places whose trouble was told before.
    """

    def __init__(self, known: set[str]) -> None:
        self.found: list[Exception] = []
        self._places = known

    def note(self, place: str, problem: Exception) -> None:
        """Keep the first problem of a device, or of another place."""
        if place not in self._places:
            self._places.add(place)
            self.found.append(problem)

    def catch(self, action: Callable[[], object], place: str | None = None) -> bool:
        """Act, and keep what is raised; tell whether nothing was."""
        try:
            action()
        except Exception as error:  # whatever it was, the next step towards the safe state must still be taken
            if place is not None:
                self.note(place, error)
            elif not any(error is known for known in self.found):
                self.found.append(error)
            return False
        return True


def _runs_away(cause: RigError | None) -> bool:
    """Tell whether a shaft moves on while its torque is slowly taken away, or may do so unseen."""
    return isinstance(cause, ReadingError) or (isinstance(cause, LimitError) and cause.signal in RUNAWAY)


def _told(problem: Exception) -> str:
    """Say what a problem was, without what to do: the error that ended the run says that."""
    return f"{type(problem).__name__}: {problem.message if isinstance(problem, RigError) else problem}"


def _on_the_way(problem: Exception) -> RigError:
    if isinstance(problem, RigError):
        return problem
    wrapped = RigError(f"Taking the torque away went wrong: {type(problem).__name__}: {problem}.")
    wrapped.__cause__ = problem
    return wrapped
