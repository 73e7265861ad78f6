"""Run every benchmark, or those named on the command line: `python -m tests.benchmarks cycle startup`."""

import importlib
import pkgutil
import sys

import tests.benchmarks


def main() -> None:
    known = [module.name for module in pkgutil.iter_modules(tests.benchmarks.__path__) if module.name != "__main__"]
    names = sys.argv[1:] or known
    unknown = [name for name in names if name not in known]
    if unknown:
        sys.exit(f"no benchmark {', '.join(unknown)}; there are {', '.join(known)}")
    for name in names:
        print(f"\n{name}")
        importlib.import_module(f"tests.benchmarks.{name}").main()


if __name__ == "__main__":
    main()
