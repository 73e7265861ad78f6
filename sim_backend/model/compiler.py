"""Turn generated source into functions: compiled by numba and cached per user, or run as plain Python.

numba's own cache does not notice an edit in another file. So everything a kernel consists of is one text, in a file
named by the hash of that text and the numba version: other text, other file. The cache saves time and nothing hangs on
it: what cannot be kept is compiled again, and what others own or may write to is never run.
"""

import hashlib
import importlib.util
import os
import stat
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from sim_backend.errors import ModelError

_PLAIN = "def compiled(function):\n    return function\n"
# without forceinline LLVM leaves the solvers out of line, and a step of the plant costs half as much again
_ALONE = "import numba\n\ncompiled = numba.njit(nogil=True, error_model='numpy', forceinline=True)\n"
_COMPILED = _ALONE.replace("njit(", "njit(cache=True, ")
_HEADER = '''"""{title}. Generated; edits here are lost."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

{compiler}

{body}
'''


class Functions:
    """Compiled functions of one text, by name. Whatever is wrong with numba's cache of them costs only that cache."""

    def __init__(self, module: ModuleType, alone: str, folder: Path) -> None:
        """Take the `module` with the functions, and `alone`, the same text without a cache."""
        self._module = module
        self._alone = alone
        self._folder = folder

    def __getattr__(self, function: str) -> Callable[..., Any]:
        if not hasattr(self._module, function):
            raise AttributeError(function)
        return partial(self._call, function)

    def _call(self, function: str, *arguments: object) -> Any:
        """Call; the first call compiles, and reads and writes the cache. What fails there is done again without it."""
        for remedy in (self._discard, self._do_without):
            try:
                return getattr(self._module, function)(*arguments)
            except Exception as error:  # a spoilt cache fails with whatever its bytes lead to
                if not _of_numbas_cache(error):
                    raise
            remedy()
        return getattr(self._module, function)(*arguments)

    def _discard(self) -> None:
        _discard(self._folder, self._module.__name__)

    def _do_without(self) -> None:
        self._module = sys.modules[self._module.__name__] = _run(self._alone, self._module.__name__)


def load(title: str, body: str, *, compiled: bool = True) -> ModuleType | Functions:
    """Give the functions of `body`, each decorated with `@compiled`.

    Without numba, or with compiled=False, the same source runs as plain Python. What cannot be kept in the user's cache
    is compiled for this process alone. Raises ModelError if the cache folder belongs to somebody else.
    """
    if not compiled or not has_numba():
        return _run(kernel_text(title, _PLAIN, body))
    import numba  # slow to import, and only here

    text = kernel_text(title, _COMPILED, body)
    digest = hashlib.sha256(numba.__version__.encode() + text.encode()).hexdigest()
    name = f"harmonic_rig_{digest[:24]}"
    folder = cache_folder()
    alone = kernel_text(title, _ALONE, body)
    if name not in sys.modules:
        # registered, because numba finds a cached function's module by its name, and to be compiled once a process
        sys.modules[name] = _cached(name, text, folder) or _run(alone, name)
    return Functions(sys.modules[name], alone, folder)


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
    if _is_foreign(status):
        raise ModelError(
            f"{folder} holds code that this program runs, but others own it or may write to it "
            f"(owner {status.st_uid}, mode {stat.S_IMODE(status.st_mode):o}). Remove it, or set XDG_CACHE_HOME."
        )
    return folder


def own_content(path: Path) -> bytes | None:
    """Give what is in a file that nobody else owns, links to or may write; None if there is no such file."""
    if not _is_own(path):
        return None
    try:
        return path.read_bytes()
    except OSError:
        return None


def keep(path: Path, content: bytes) -> bool:
    """Write the file in one piece, so that another process never reads half of it; tell whether that was possible."""
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).replace(path)
    except OSError:  # a folder that cannot be written, a full disk, a folder in its place
        if temporary is not None:
            with suppress(OSError):
                Path(temporary).unlink()
        return False
    return True


def _is_own(path: Path) -> bool:
    """Tell whether there is a plain file, or a folder, that nobody else owns or may write."""
    try:
        status = path.lstat()
    except OSError:
        return False
    plain = stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)
    return plain and not _is_foreign(status)


def _is_foreign(status: os.stat_result) -> bool:
    """Tell whether others own something or may write to it."""
    another = hasattr(os, "getuid") and status.st_uid != os.getuid()
    return another or (os.name == "posix" and bool(stat.S_IMODE(status.st_mode) & 0o022))


def _cached(name: str, text: str, folder: Path) -> ModuleType | None:
    """Give the module with numba's cache for its functions; None if the text or that cache cannot be kept there."""
    path = folder / f"{name}.py"
    if own_content(path) != text.encode() and not keep(path, text.encode()):
        return None
    compiled = folder / "__pycache__"
    if not os.access(folder, os.W_OK | os.X_OK) or (compiled.exists() and not _is_own(compiled)):
        return None
    if not all(_is_own(file) for file in compiled.glob(f"{name}.*")):
        _discard(folder, name)
    try:
        return _run(text, name, path)
    except Exception:  # numba finds no place for its cache, or cannot read what is there
        sys.modules.pop(name, None)
        return None


def _discard(folder: Path, name: str) -> None:
    """Remove what numba keeps of a module."""
    for file in (folder / "__pycache__").glob(f"{name}.*"):
        with suppress(OSError):
            file.unlink()


def _of_numbas_cache(error: Exception) -> bool:
    """Tell whether an exception was raised where numba reads or writes its cache."""
    from numba.core import caching  # numba is there: it raised

    frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
    return any(frame.f_code.co_filename == caching.__file__ for frame in frames)


def _run(text: str, name: str = "harmonic_rig_plain", path: Path | None = None) -> ModuleType:
    """Give the module of a text; of one in a file, numba keeps what it compiles beside that file."""
    module = ModuleType(name)
    if path is not None:
        module.__file__ = str(path)
        sys.modules[name] = module
    exec(compile(text, "<generated plant>" if path is None else str(path), "exec"), module.__dict__)
    return module
