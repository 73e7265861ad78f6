"""Pieces of Python source for generated modules: definitions of a module, an effect's function under another name."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterable
from functools import cache
from types import ModuleType

from sim_backend.errors import ModelError
from sim_backend.model.effects import operators

ALLOWED_GLOBALS = frozenset({"math", "np", "abs", "min", "max", "float", "int", "bool", "range", "round"})
"""What an effect's function may use besides its arguments and the operators: a generated module has nothing else."""


@cache
def definitions(module: ModuleType, *only: str) -> str:
    """Give the constants, functions and tuple classes which `module` defines, without its imports and docstring.

    only: names of the functions and classes wanted, if not all.
    """
    kept = []
    for node in ast.parse(inspect.getsource(module)).body:
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Expr):
            continue
        if not only or (isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name in only):
            kept.append(node)
    return "\n\n".join(_decorated(node) for node in kept)


def function_source(function: Callable[..., float], name: str) -> str:
    """Give the source of a scalar function, renamed to `name`.

    Raises ModelError if its source is out of reach or if it uses more than its arguments, math and numpy (as np).
    """
    try:
        text = textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError) as error:
        raise ModelError(f"{function!r} cannot be compiled: its source cannot be read ({error}).") from error
    try:
        node = ast.parse(text).body[0]
    except SyntaxError:  # a lambda's source is the line around it, which need not stand alone
        node = ast.Pass()
    if not isinstance(node, ast.FunctionDef):
        raise ModelError(f"{function!r} cannot be compiled: an effect is a plain function written with def.")
    used = inspect.getclosurevars(function)
    foreign = (set(used.globals) | set(used.nonlocals) | set(used.builtins) | used.unbound) - ALLOWED_GLOBALS
    foreign -= _operators(function)
    foreign -= {attribute.attr for attribute in ast.walk(node) if isinstance(attribute, ast.Attribute)}
    if foreign:
        raise ModelError(
            f"{node.name}() cannot be compiled: it uses {', '.join(sorted(foreign))}. An effect's function may use "
            f"its arguments, {', '.join(sorted(ALLOWED_GLOBALS))} and the operators of {operators.__name__}; write "
            f"other constants inside it."
        )
    node.name = name
    node.decorator_list = []
    return _decorated(node)


def operators_of(functions: Iterable[Callable[..., float]]) -> str:
    """Give the definitions of the operators that the functions call, each once; `function_source` leaves them out."""
    used = set().union(*(_operators(function) for function in functions))
    return definitions(operators, *sorted(used)) if used else ""


def _operators(function: Callable[..., float]) -> set[str]:
    """Give the names of the operators that the function calls by these names."""
    used = inspect.getclosurevars(function).globals
    return {name for name, value in used.items() if value is getattr(operators, name, None) and callable(value)}


def _decorated(node: ast.stmt) -> str:
    """Give the source of one definition; functions are marked for compilation."""
    text = ast.unparse(node)
    return f"@compiled\n{text}" if isinstance(node, ast.FunctionDef) else text
