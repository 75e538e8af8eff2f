"""A residual network from the bands of a camera to leaf chlorophyll, in JAX on the CPU."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.progress import followed
from dapple.retrieval.noise import Noise

# One thread: sums in one order, so that a seed gives the same weights whatever the machine's cores.
os.environ |= {"JAX_PLATFORMS": "cpu", "NPROC": "1"}

Weights = list[tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Network:
    """A trained network, with the scales of what goes in and comes out.

    Attributes
    ----------
    weights : list of (matrix, offset)
        Layers in order, float32.
    block : int
        Number of layers inside the residual block, which end at the last hidden layer.
    feature_mean, feature_scale : (b,) float32
        Features are shifted and divided by them.
    low, high : float
        Targets at which the sigmoid is 0 and 1.
    """

    weights: Weights
    block: int
    feature_mean: np.ndarray
    feature_scale: np.ndarray
    low: float
    high: float


def split(
    combination: np.ndarray,
    *,
    seed: int,
    test_share: float = 0.2,
    held_share: float = 0.1,
) -> dict[str, np.ndarray]:
    """Divide entries into those that teach, stop and test.

    Parameters
    ----------
    combination : (n,) int
        Combination of leaf and soil of every entry.
    seed : int
        Of the division.
    test_share : float
        Entries, of those left by `held_share`, that test (Zhao et al. 2025: 20 %).
    held_share : float
        Combinations of which no entry teaches: as many for `validation` as for `combinations`.

    Returns
    -------
    dict of str to int array
        Indices of `train`; `entries`, the published kind of test: other cells of combinations
        that also teach; `validation`, which stops the training and sets intervals; and
        `combinations`, a test on leaves and soils that the network never saw.

    Raises
    ------
    InputError
        Too few combinations to hold any back.

    Notes
    -----
    Entries of one combination are alike, so that a test by entries is an easy one.
    """
    rng = np.random.default_rng(seed)
    names = rng.permutation(np.unique(combination))
    n_held = max(1, round(held_share * len(names)))
    if len(names) < 2 * n_held + 1:
        raise InputError(
            "combinations", f"{len(names)}", "3 or more, to hold some back",
            "Simulate more combinations.",
        )  # fmt: skip
    validation = np.isin(combination, names[:n_held])
    unseen = np.isin(combination, names[n_held : 2 * n_held])
    rest = rng.permutation(np.flatnonzero(~(validation | unseen)))
    n_test = round(test_share * len(rest))
    return {
        "train": np.sort(rest[n_test:]),
        "entries": np.sort(rest[:n_test]),
        "validation": np.flatnonzero(validation),
        "combinations": np.flatnonzero(unseen),
    }


def train(
    features: np.ndarray,
    target: np.ndarray,
    validation_features: np.ndarray,
    validation_target: np.ndarray,
    *,
    seed: int,
    low: float = 4.0,
    high: float = 76.0,
    hidden: tuple[int, ...] = (800, 400, 200),
    block: int = 3,
    learning_rate: float = 0.001,
    last_rate_share: float = 0.01,
    weight_decay: float = 0.001,
    batch: int = 512,
    max_epochs: int = 30,
    patience: int = 12,
    noise: Noise | None = None,
) -> tuple[Network, pd.DataFrame]:
    """Train a network.

    Parameters
    ----------
    features, validation_features : (n, b) float32
        Bands.
    target, validation_target : (n,) float
        What to predict, such as chlorophyll [µg cm⁻²].
    seed : int
        Of the first weights and of the order of entries.
    low, high : float
        Targets at which the sigmoid is 0 and 1; a little beyond the range of the targets, which
        a sigmoid reaches at infinity only.
    hidden : tuple of int
        Widths of the hidden layers before the block.
    block : int
        Layers, as wide as the last one, inside the residual block.
    learning_rate, weight_decay : float
        Of Adam with decoupled weight decay (Loshchilov and Hutter 2019).
    last_rate_share : float
        The rate falls along a cosine to this share of itself at `max_epochs`.
    batch, max_epochs : int
        Entries per step; passes over all entries.
    patience : int
        Epochs without a better validation loss after which training stops. The weights of the
        best epoch are kept.
    noise : Noise or None
        Errors that are added to the bands, new ones in every epoch, and to those of validation.

    Returns
    -------
    Network
    history : DataFrame
        `epoch`, `train_loss` (mean over the epoch's batches) and `validation_loss`, mean squared
        errors of scaled targets.

    Notes
    -----
    Layers, activation (ReLU), residual block from the third to the last hidden layer, sigmoid,
    loss, rate and decay: Zhao et al. (2025).
    """
    rng = np.random.default_rng(seed)
    mean, scale = features.mean(axis=0, dtype=np.float64), features.std(axis=0, dtype=np.float64)
    mean, scale = mean.astype(np.float32), np.maximum(scale, 1e-6).astype(np.float32)
    if noise:
        validation_features = noise.add(validation_features, rng)
    x, x_valid = ((f - mean) / scale for f in (features, validation_features))
    y, y_valid = (
        ((t - low) / (high - low)).astype(np.float32) for t in (target, validation_target)
    )
    n_steps = max_epochs * max(1, len(x) // batch)
    optimizer, step = _compiled_step(block, learning_rate, last_rate_share, n_steps, weight_decay)
    weights = _first_weights(rng, (features.shape[1], *hidden, *[hidden[-1]] * block, 1))
    state = optimizer.init(weights)
    best, best_loss, best_epoch, rows = weights, np.inf, 0, []
    for epoch in followed(range(1, max_epochs + 1), "epochs, if none is without gain"):
        losses = []
        if noise:
            x = (noise.add(features, rng) - mean) / scale
        for rows_of_batch in _batches(rng.permutation(len(x)), batch):
            weights, state, value = step(weights, state, x[rows_of_batch], y[rows_of_batch])
            losses.append(value)
        scaled = _scaled_prediction(weights, x_valid, block)
        validation_loss = float(np.mean((scaled - y_valid) ** 2))
        rows.append((epoch, float(np.mean(losses)), validation_loss))
        if validation_loss < best_loss:
            best, best_loss, best_epoch = weights, validation_loss, epoch
        if epoch - best_epoch >= patience:
            break
    kept = [(np.asarray(matrix), np.asarray(offset)) for matrix, offset in best]
    history = pd.DataFrame(rows, columns=["epoch", "train_loss", "validation_loss"])
    return Network(kept, block, mean, scale, low, high), history


def predict(network: Network, features: np.ndarray) -> np.ndarray:
    """Predict the target (n,), float64, from bands (n, b); NaN where a band is NaN."""
    x = (np.asarray(features, np.float32) - network.feature_mean) / network.feature_scale
    scaled = _scaled_prediction(network.weights, x, network.block)
    return network.low + (network.high - network.low) * scaled.astype(np.float64)


def _first_weights(rng: np.random.Generator, widths: tuple[int, ...]) -> Weights:
    """Normal weights of variance 2 / inputs (He et al. 2015), offsets zero."""
    return [
        (
            (rng.standard_normal((n_in, n_out)) * np.sqrt(2.0 / n_in)).astype(np.float32),
            np.zeros(n_out, np.float32),
        )
        for n_in, n_out in pairwise(widths)
    ]


def _forward(weights, x, block):
    import jax

    *inner, (matrix, offset) = weights
    before = len(inner) - block
    for layer, (inside, shift) in enumerate(inner):
        x = jax.nn.relu(x @ inside + shift)
        if layer == before - 1:
            skipped = x
    return jax.nn.sigmoid((x + skipped) @ matrix + offset)[:, 0]


@cache
def _compiled_step(
    block: int, learning_rate: float, last_rate_share: float, n_steps: int, weight_decay: float
):
    """The optimizer and one step of it; networks of other seeds need no compiling of their own."""
    import jax
    import optax

    rate = optax.cosine_decay_schedule(learning_rate, n_steps, last_rate_share)
    optimizer = optax.adamw(rate, weight_decay=weight_decay)

    def loss(weights, x, y):
        return ((_forward(weights, x, block) - y) ** 2).mean()

    @jax.jit
    def step(weights, state, x, y):
        value, gradient = jax.value_and_grad(loss)(weights, x, y)
        update, state = optimizer.update(gradient, state, weights)
        return optax.apply_updates(weights, update), state, value

    return optimizer, step


@cache
def _compiled_forward():
    import jax

    return jax.jit(_forward, static_argnums=2)


def _batches(order: np.ndarray, batch: int) -> Iterator[np.ndarray]:
    """Whole batches only, so that one kernel serves all; few entries make one batch."""
    size = min(batch, len(order))
    for start in range(0, len(order) - size + 1, size):
        yield order[start : start + size]


def _scaled_prediction(weights: Weights, x: np.ndarray, block: int, chunk: int = 4096):
    """The sigmoid for every row, in chunks of one size: memory stays small, one kernel serves."""
    forward = _compiled_forward()
    padded = np.zeros((-(-len(x) // chunk) * chunk, x.shape[1]), np.float32)
    padded[: len(x)] = x
    parts = [
        np.asarray(forward(weights, padded[start : start + chunk], block))
        for start in range(0, len(padded), chunk)
    ]
    return np.concatenate(parts)[: len(x)] if parts else np.zeros(0, np.float32)


def write(path: str | Path, network: Network) -> None:
    """Write a network as a NumPy archive."""
    arrays: dict[str, Any] = {
        "feature_mean": network.feature_mean,
        "feature_scale": network.feature_scale,
    }
    for layer, (matrix, offset) in enumerate(network.weights):
        arrays[f"matrix_{layer}"], arrays[f"offset_{layer}"] = matrix, offset
    scalars: dict[str, Any] = {"block": network.block, "low": network.low, "high": network.high}
    with atomic(path) as partial:
        np.savez(partial, **arrays, **scalars)


def read(path: str | Path) -> Network:
    """Read a network that `write` wrote."""
    with np.load(path) as archive:
        n_layers = sum(name.startswith("matrix_") for name in archive.files)
        weights = [(archive[f"matrix_{i}"], archive[f"offset_{i}"]) for i in range(n_layers)]
        return Network(
            weights,
            int(archive["block"]),
            archive["feature_mean"],
            archive["feature_scale"],
            float(archive["low"]),
            float(archive["high"]),
        )
