"""Turn generated source into functions: compiled by numba and cached per user, or run as plain Python.

numba's own cache does not notice an edit in another file. So everything a kernel consists of is one text, in a file
named by the hash of that text and the numba version: other text, other file.
"""

import hashlib
import importlib.util
import os
import stat
import sys
import tempfile
from pathlib import Path
from types import ModuleType

from sim_backend.errors import ModelError

_PLAIN = "def compiled(function):\n    return function\n"
# without forceinline LLVM leaves the solvers out of line, and a step of the plant costs half as much again
_COMPILED = "import numba\n\ncompiled = numba.njit(cache=True, nogil=True, error_model='numpy', forceinline=True)\n"
_HEADER = '''"""{title}. Generated; edits here are lost."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

{compiler}

{body}
'''


def load(title: str, body: str, *, compiled: bool = True) -> ModuleType:
    """Give the module with the functions of `body`, each decorated with `@compiled`.

    Without numba, or with compiled=False, the same source runs as plain Python.
    Raises ModelError if the user's cache folder belongs to somebody else.
    """
    if not compiled or not has_numba():
        return _run(kernel_text(title, _PLAIN, body))
    import numba  # slow to import, and only here

    text = kernel_text(title, _COMPILED, body)
    digest = hashlib.sha256(numba.__version__.encode() + text.encode()).hexdigest()
    name = f"harmonic_rig_{digest[:24]}"
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if not path.is_file() or path.read_text("utf-8") != text:
        write_whole(path, text.encode())
    return _import(name, path)


def has_numba() -> bool:
    """Tell whether there is a compiler, without importing it."""
    return importlib.util.find_spec("numba") is not None


def kernel_text(title: str, compiler: str, body: str) -> str:
    """Give the source of a module; `compiler` defines the decorator `compiled`."""
    return _HEADER.format(title=title, compiler=compiler, body=body)


def cache_folder() -> Path:
    """Give the user's own folder for generated kernels, made on demand with access for nobody else.

    Where the home cannot be written, a folder for this process alone; kernels are then compiled in every process.
    Raises ModelError if the folder exists but others own it or may write to it.
    """
    root = os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache"
    folder = Path(root) / "harmonic-rig" / "kernels"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="harmonic-rig-"))
    status = folder.stat()
    foreign = hasattr(os, "getuid") and status.st_uid != os.getuid()
    if foreign or (os.name == "posix" and stat.S_IMODE(status.st_mode) & 0o022):
        raise ModelError(
            f"{folder} holds code that this program runs, but others own it or may write to it "
            f"(owner {status.st_uid}, mode {stat.S_IMODE(status.st_mode):o}). Remove it, or set XDG_CACHE_HOME."
        )
    return folder


def write_whole(path: Path, content: bytes) -> None:
    """Write the file in one piece, so that another process never reads half of it."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "wb") as file:
        file.write(content)
    Path(temporary).replace(path)


def _import(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ModelError(f"{path} cannot be imported as a Python module.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba finds a cached function's module by its name
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _run(text: str) -> ModuleType:
    module = ModuleType("harmonic_rig_plain")
    exec(compile(text, "<generated plant>", "exec"), module.__dict__)
    return module
