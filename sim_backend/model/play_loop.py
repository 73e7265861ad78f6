"""The play operator over an array, as scalar code for compilation; see `friction`."""

import numpy as np
from numpy.typing import NDArray


def play_loop(inputs: NDArray[np.float64], radius: float, state: float, outputs: NDArray[np.float64]) -> None:
    """Write the play of `inputs` into `outputs`; both shape (n,)."""
    for i in range(len(inputs)):
        state = min(max(state, inputs[i] - radius), inputs[i] + radius)
        outputs[i] = state
