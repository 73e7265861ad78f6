"""Every procedure there is, by name. A new one is one file and one line here."""

from collections.abc import Mapping
from types import MappingProxyType

from procedures import backdrive, free_run, locked_output, starting_torque
from procedures.plan import Procedure

PROCEDURES: Mapping[str, Procedure] = MappingProxyType(
    {
        entry.name: entry
        for entry in (
            starting_torque.PROCEDURE,
            locked_output.PROCEDURE,
            backdrive.PROCEDURE,
            free_run.PROCEDURE,
        )
    }
)
"""Name to procedure, in the order in which a bench is worked through."""
