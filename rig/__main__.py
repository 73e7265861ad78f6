"""Where the program starts: signals first, since the imports of a command take up to a second."""

import sys

from rig.interrupt import ignore_signals, interrupt_on_signals, raised_interrupt


def main() -> None:
    """Run the command line and leave with its exit code; a signal at any moment is an abort."""
    try:
        interrupt_on_signals()
        from rig.outlets import guard_outlets

        guard_outlets()
        from rig.cli import app

        app()
    except BaseException:  # whatever became of Interrupted on its way
        by = raised_interrupt()
        if by is None:
            raise
        ignore_signals()
        print(f"Aborted by {by}.", file=sys.stderr)
        sys.exit(4)
    finally:
        # what remains is the interpreter's own end, which would fall back to the system's reaction
        ignore_signals()


if __name__ == "__main__":
    main()
