"""Functions over arrays, compiled by numba and kept as machine code, so that a new process starts without a compiler.

numba's own cache needs all of numba in every process, and importing that takes a second. What is kept here is the
object code alone, in the user's own folder, under the hash of everything that it depends on: the text, the versions of
the compiler and of LLVM, the processor. LLVM links it in a few milliseconds.
"""

import ctypes
import hashlib
import importlib.metadata
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model.compiler import cache_folder, has_numba, keep, kernel_text, load, own_content

Array: TypeAlias = NDArray[np.float64]
Bound: TypeAlias = Callable[[int], None]
"""A function with its arrays; it takes the count."""

Calls: TypeAlias = tuple[tuple[str, str], ...]
"""Name and body of every function wanted: one call, with `*arrays` and `count` in it."""

_COMPILER = "import numba\n\ncompiled = numba.njit(error_model='numpy', forceinline=True)"
_ENTRY = "def {name}_entry(arrays, count):\n    {call}"
_MACHINE_ENTRY = """
@numba.cfunc("void(CPointer(CPointer(float64)), int64)", error_model="numpy")
def {name}_entry(addresses, count):
    arrays = ({arrays})
    {call}"""
_SYMBOL = "harmonic_rig_{name}"
_ENTRY_TYPE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)  # runs without the interpreter's lock


def bind(title: str, body: str, calls: Calls, arrays: Sequence[Array], *, compiled: bool = True) -> dict[str, Bound]:
    """Give functions of `body`, each of them decorated there with `@compiled`, working on `arrays`.

    Without numba, or with compiled=False, the same source runs as plain Python; code that cannot be kept (it calls what
    not every process has, as an exception does) is left to numba's own cache.
    Raises ModelError unless every array is of float64, of one dimension and in one piece.
    """
    for number, array in enumerate(arrays):
        if array.dtype != np.float64 or array.ndim != 1 or not array.flags.c_contiguous:
            raise ModelError(
                f"array {number} has the shape {array.shape} of {array.dtype}; it must be (n,) of float64."
            )
    sizes = tuple(array.size for array in arrays)
    kept = _machine_code(title, body, calls, sizes) if compiled and has_numba() else None
    if kept is None:
        entries = [_ENTRY.format(name=name, call=call) for name, call in calls]
        module: Any = load(title, "\n\n".join([body, *entries]), compiled=compiled)
        return {name: partial(getattr(module, f"{name}_entry"), tuple(arrays)) for name, _ in calls}
    pointer = ctypes.POINTER(ctypes.c_double)
    table = (pointer * len(sizes))(*[ctypes.cast(_buffer(array), pointer) for array in arrays])  # keeps the buffers
    return {name: partial(function, table) for name, function in kept.items()}


def _buffer(array: Array) -> ctypes.Array[ctypes.c_double]:
    """Give the array's own memory; it keeps the array alive and its size fixed."""
    return (ctypes.c_double * array.size).from_buffer(array.data)


@cache
def _machine_code(title: str, body: str, calls: Calls, sizes: tuple[int, ...]) -> Mapping[str, Any] | None:
    """Give functions of (table of addresses, count) from the user's cache, compiled on demand; None: cannot be kept."""
    import llvmlite.binding as llvm  # slow to import, and only here

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    arrays = "".join(f"numba.carray(addresses[{k}], ({size},)), " for k, size in enumerate(sizes))
    entries = [_MACHINE_ENTRY.format(name=name, call=call, arrays=arrays) for name, call in calls]
    text = kernel_text(title, _COMPILER, "\n\n".join([body, *entries]))
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple().create_target_machine(cpu=cpu, features=features, opt=3, jit=True)
    versions = [importlib.metadata.version(name) for name in ("numba", "llvmlite")]
    digest = hashlib.sha256("\n".join([*versions, target.triple, cpu, features, text]).encode()).hexdigest()
    path = cache_folder() / f"harmonic_rig_{digest[:24]}.o"
    names = [name for name, _ in calls]
    code = _unsealed(own_content(path) or b"")
    if code is None:
        code = _compile(llvm, target, text, names)
        if code is None:
            return None
        keep(path, _sealed(code))
    return _link(llvm, target, code, names)


def _compile(llvm: Any, target: Any, text: str, names: Sequence[str]) -> bytes | None:
    """Give the object code of the entries of the text; None if it calls what not every process has."""
    namespace: dict[str, Any] = {"__name__": "harmonic_rig_kernel"}
    exec(compile(text, "<generated kernel>", "exec"), namespace)
    modules = [_module(llvm, namespace[f"{name}_entry"], _SYMBOL.format(name=name)) for name in names]
    whole = modules[0]
    for module in modules[1:]:
        whole.link_in(module)
    # now that LLVM sees all callers, what numba does on an exception turns out unreachable, and goes
    builder = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=3))
    builder.getModulePassManager().run(whole, builder)
    foreign = [f for f in whole.functions if f.is_declaration and not _everywhere(f.name)]
    foreign += [v for v in whole.global_variables if v.is_declaration]
    return None if foreign else bytes(target.emit_object(whole))


def _module(llvm: Any, entry: Any, symbol: str) -> Any:
    """Give the module of one compiled entry, with nothing to be seen from outside but that, as `symbol`."""
    module = llvm.parse_assembly(entry.inspect_llvm())
    for defined in (*module.functions, *module.global_variables):
        if not defined.is_declaration and defined.name != entry.native_name:
            defined.linkage = "internal"
    module.get_function(entry.native_name).name = symbol
    return module


def _everywhere(symbol: str) -> bool:
    """Tell whether a function is LLVM's own or of C's mathematical library, whose names Python's `math` shares."""
    return symbol.startswith("llvm.") or hasattr(math, symbol)


def _link(llvm: Any, target: Any, code: bytes, names: Sequence[str]) -> Mapping[str, Any]:
    builder = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    for name in names:
        builder.export_symbol(_SYMBOL.format(name=name))
    library = builder.link(llvm.create_lljit_compiler(target), "harmonic_rig")
    functions: dict[str, Any] = {name: _ENTRY_TYPE(library[_SYMBOL.format(name=name)]) for name in names}
    for function in functions.values():
        function.library = library  # it owns the code
    return functions


def _sealed(code: bytes) -> bytes:
    return hashlib.sha256(code).digest() + code


def _unsealed(file: bytes) -> bytes | None:
    """Give the code, or None if the file is not what was written."""
    seal, code = file[:32], file[32:]
    return code if hashlib.sha256(code).digest() == seal else None
