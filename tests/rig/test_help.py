import subprocess
import sys

HEAVY = ("numpy", "numba", "scipy", "can", "canopen", "h5py", "matplotlib", "mcap", "pydantic", "google.protobuf")


def test_help_imports_none_of_the_heavy_packages():
    code = (
        "import sys\n"
        "from rig.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        f"print('LOADED', [name for name in {HEAVY!r} if name in sys.modules])\n"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Usage" in answer.stdout
    assert answer.stdout.splitlines()[-1] == "LOADED []"
