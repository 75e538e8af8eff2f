"""How well predicted classes agree with the truth."""

import numpy as np
from sklearn.metrics import cohen_kappa_score, precision_recall_fscore_support

from dapple.errors import EmptyCloudError, InputError
from dapple.formats.clouds import LEAF, WOOD


def scores(predicted: np.ndarray, truth: np.ndarray) -> dict:
    """Precision, recall and F1 of leaf and wood, accuracy and Cohen's kappa.

    Parameters
    ----------
    predicted, truth : (n,) array
        Class codes: 4 leaf, 0 wood. Points whose true class is something else (ground, noise)
        do not count, and their number is given.

    Returns
    -------
    dict
        `n`, `n_other`, `accuracy`, `kappa`, and for `leaf` and `wood`: `precision`, `recall`,
        `f1`, `n` (true number). A ratio without a denominator is 0; kappa is NaN where truth
        and prediction hold one and the same class only.

    Raises
    ------
    InputError
        The lengths differ, or a prediction is neither leaf nor wood.
    EmptyCloudError
        No point is truly leaf or wood.
    """
    predicted, truth = np.asarray(predicted), np.asarray(truth)
    if predicted.shape != truth.shape:
        raise InputError(
            "classes",
            f"{predicted.shape} predicted and {truth.shape} true classes",
            "one of each per point",
            "Compare classes of the same cloud.",
        )
    counts = np.isin(truth, (LEAF, WOOD))
    if not counts.any():
        raise EmptyCloudError(
            "true classes", "neither leaf (4) nor wood (0)", "some", "Check the truth's codes."
        )
    chosen, true = predicted[counts], truth[counts]
    if strange := sorted(set(np.unique(chosen).tolist()) - {LEAF, WOOD}):
        raise InputError("classes", f"codes {strange}", "4 leaf or 0 wood", "Classify all points.")
    table = precision_recall_fscore_support(true, chosen, labels=[LEAF, WOOD], zero_division=0)
    one_class = len(np.union1d(chosen, true)) == 1
    names = ("precision", "recall", "f1", "n")
    return {
        "n": len(true),
        "n_other": int(np.count_nonzero(~counts)),
        "accuracy": float(np.mean(chosen == true)),
        "kappa": float("nan") if one_class else float(cohen_kappa_score(true, chosen)),
        **{
            which: {
                name: (int if name == "n" else float)(column[i])
                for name, column in zip(names, table, strict=True)
            }
            for i, which in enumerate(("leaf", "wood"))
        },
    }
