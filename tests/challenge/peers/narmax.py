"""SysIdentPy: forward selection of a finite impulse response with the number of terms by the Bayesian criterion.

It has no training on several runs: they follow each other in one record.
"""

import numpy as np
from numpy.typing import NDArray
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

from tests.challenge.peers.columns import Task

Floats = NDArray[np.float64]

MOST_TERMS = 10


def frols_bic(task: Task) -> Floats:
    """Give the coefficients of forward selection."""
    count = task.X.shape[1]
    model = FROLS(
        order_selection=True,
        n_info_values=MOST_TERMS,
        info_criteria="bic",
        model_type="NFIR",
        xlag=[[1]] * count,
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(),
    )
    # a lag of one is the least there is: the columns come one sample earlier
    model.fit(X=np.roll(task.X, -1, axis=0), y=task.y[:, None])
    found = np.zeros(count)
    for code, value in zip(np.asarray(model.final_model).ravel().tolist(), np.ravel(model.theta).tolist(), strict=True):
        if code:  # 0 is the constant; 2001 is the first input one sample before, 3001 the second
            found[code // 1000 - 2] = value
    return found
