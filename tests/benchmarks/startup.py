"""`rig --help` against an empty typer application, each a fresh process, in turn."""

import statistics
import subprocess
import sys
import time

EMPTY = """
import typer
app = typer.Typer(add_completion=False)
@app.command()
def one() -> None:
    "One."
@app.command()
def two() -> None:
    "Two."
app()
"""
RIG = "from rig.__main__ import main; main()"
ROUNDS = 15


def seconds(code: str) -> float:
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", code, "--help"], check=True, capture_output=True)
    return time.perf_counter() - begin


def main() -> None:
    seconds(EMPTY), seconds(RIG)
    ratios, empty, rig = [], [], []
    for _ in range(ROUNDS):
        a, b = seconds(EMPTY), seconds(RIG)
        empty.append(a), rig.append(b), ratios.append(b / a)
    print(f"  empty typer application {statistics.median(empty) * 1e3:6.0f} ms")
    print(f"  rig --help              {statistics.median(rig) * 1e3:6.0f} ms")
    print(f"  ratio, median of {ROUNDS}     {statistics.median(ratios):6.2f}   (wanted: at most 1.5)")


if __name__ == "__main__":
    main()
