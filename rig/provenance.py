"""Where a result comes from: software version, state of its checkout, operator."""

import getpass
import hashlib
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DISTRIBUTION = "harmonic-rig"

MODEL_MARK = "sha256:"
"""What a log's backend holds if the simulated bench ran a model file."""


def software_version() -> str:
    """Give name and version of this software."""
    try:
        return f"{DISTRIBUTION} {version(DISTRIBUTION)}"
    except PackageNotFoundError:
        return f"{DISTRIBUTION} (not installed)"


def git_state() -> str:
    """Give commit and cleanliness of the checkout this software runs from, "" outside of one."""
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return ""
    try:
        answer = subprocess.run(
            ["git", "-C", str(root), "describe", "--always", "--dirty"],
            capture_output=True,
            text=True,
            timeout=5,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return answer.stdout.strip()


def operator_name() -> str:
    """Give the login name of the person at the terminal, "unknown" where there is none."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "unknown"


def file_identity(path: Path) -> str:
    """Give a file's name and the start of the SHA-256 of what it holds: which one it was, not where it lay."""
    return f"{path.name} {MODEL_MARK}{hashlib.sha256(path.read_bytes()).hexdigest()[:16]}"
