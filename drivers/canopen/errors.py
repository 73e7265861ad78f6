"""Two errors of CANopen devices, both `DriveFaultError` to whoever handles them, and how several become one."""

from collections.abc import Sequence

from drivers.errors import DriveFaultError, RigError


class DeviceFaultError(DriveFaultError):
    """A device that need not be a drive refused, failed or restarted."""

    noun = "Device"


class SdoAbortError(DeviceFaultError):
    """The device answered an object access with an SDO abort. Attribute `abort_code` (CiA 301)."""

    def __init__(self, device: str, what: str, *, abort_code: int, hint: str = "") -> None:
        super().__init__(device, what, state="", hint=hint)
        self.abort_code = abort_code
        self.facts["abort_code"] = abort_code


def raise_together(errors: Sequence[RigError]) -> None:
    """Raise the first error with the others as notes; do nothing if there is none."""
    if errors:
        for other in errors[1:]:
            for text in (str(other), *getattr(other, "__notes__", ())):
                errors[0].add_note(text)
        raise errors[0]
