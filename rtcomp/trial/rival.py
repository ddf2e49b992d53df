"""Rivals on the same cases: sysidentpy's FROLS and pysindy's ensemble, over one table of columns.

Run as ``python -m rtcomp.trial.rival RIVAL CASE_FOLDER OUT.json``; writes what the rival names in the form
of ``diagnosis.json``.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import warnings
from pathlib import Path

import numpy as np

from rtcomp.trial.columns import Columns, columns_of
from rtcomp.trial.stagefile import MOVED

RIVALS = {"frols": "sysidentpy", "sindy": "pysindy"}
"""Rivals, and the package that each needs (extras group `rivals`)."""
CHOSEN = 0.6
"""Part of the ensemble's members that must hold a term."""
TERMS = 12
"""Terms among which FROLS's information criterion chooses."""


def missing(rival: str) -> bool:
    """Say whether the package of a rival is not installed."""
    return importlib.util.find_spec(RIVALS[rival]) is None


def frols(table: Columns) -> list[str]:
    """Return the effects that FROLS chooses (BIC), by the error that they take away.

    Billings (2013), Nonlinear System Identification, forward regression by orthogonal least squares; a
    model without memory of its own (NFIR), each column an input.
    """
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    wide = [i for i, c in enumerate(table.columns.T) if float(np.std(c)) > 1e-9]
    model = FROLS(
        order_selection=True, info_criteria="bic", n_info_values=min(TERMS, len(wide)),
        xlag=[[1]] * len(wide), ylag=1, model_type="NFIR", estimator=LeastSquares(),
        basis_function=Polynomial(degree=1),
    )  # fmt: skip
    # Its smallest lag is one row: the columns are handed over a row early.
    x = np.vstack([table.columns[1:, wide], table.columns[-1:, wide]])
    model.fit(X=x, y=table.force.reshape(-1, 1))
    found = []
    for regressor in model.final_model[:, 0]:
        # 0 is the constant, 2001 the first input a row ago, 3001 the second ...
        found.append("constant-force" if regressor < 2000 else table.names[wide[int(regressor) // 1000 - 2]])
    return found


def sindy(table: Columns) -> list[str]:
    """Return the effects that most of an ensemble of sparse regressions holds, by size.

    Fasel, Kutz, Brunton, Brunton (2022), Proc. R. Soc. A 478: STLSQ on resampled rows.
    """
    from pysindy.optimizers import STLSQ, EnsembleOptimizer

    size = float(np.sqrt(np.mean(table.force**2)))
    single = STLSQ(threshold=0.1 * size, alpha=0.01 * table.force.size)
    np.random.seed(0)  # the ensemble draws from numpy's global generator
    ensemble = EnsembleOptimizer(single, bagging=True, n_models=20)
    ensemble.fit(table.columns, table.force.reshape(-1, 1))
    coefficients = np.array(ensemble.coef_list).reshape(20, -1)
    often = np.mean(coefficients != 0.0, axis=0)
    strong = np.abs(np.median(coefficients, axis=0))
    return [table.names[i] for i in np.argsort(-strong) if often[i] >= CHOSEN and strong[i] > 0.0]


def name(rival: str, folder: Path) -> dict[str, object]:
    """Return what a rival says of a case, in the form of ``diagnosis.json``."""
    table = columns_of(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        named = list(dict.fromkeys({"frols": frols, "sindy": sindy}[rival](table)))
    moved = [(key, a, b) for key, a, b in table.retuned if a and abs(b / a - 1.0) > MOVED]
    return {
        "verdict": "missing-physics" if named else "retuned" if moved else "consistent",
        "effects": [{"names": [n], "parameters": {}} for n in named],
        "retuned": [{"parameter": key, "from": a, "to": b, "low": b, "high": b} for key, a, b in moved],
    }


if __name__ == "__main__":
    said = name(sys.argv[1], Path(sys.argv[2]))
    out = Path(sys.argv[3])
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(said), encoding="utf-8")
