import os
import subprocess
import sys

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.retrieval import intervals, network
from dapple.retrieval.noise import Noise

SMALL = {"hidden": (32, 16, 8), "batch": 64, "max_epochs": 60, "patience": 60}


def world(n, seed=1):
    """Bands that a number between 10 and 70 brings about, with a nuisance."""
    rng = np.random.default_rng(seed)
    target, bright = rng.uniform(10, 70, n), rng.uniform(0.5, 1.5, n)
    slopes = np.array([0.01, 0.03, 0.015, 0.02, 0.0])
    bands = bright[:, None] * np.exp(-slopes * target[:, None])
    return bands.astype(np.float32), target


@pytest.fixture(scope="module")
def trained():
    return network.train(*world(2000), *world(300, seed=2), seed=3, **SMALL)


def test_it_learns_what_bands_tell(trained):
    features, target = world(500, seed=4)
    error = network.predict(trained[0], features) - target
    assert np.sqrt(np.mean(error**2)) < 0.15 * target.std()


def test_the_layers_are_as_published():
    net, _ = network.train(*world(20), *world(10), seed=1, max_epochs=1)
    shapes = [matrix.shape for matrix, _ in net.weights]
    inner = [(5, 800), (800, 400), (400, 200), (200, 200), (200, 200), (200, 200), (200, 1)]
    assert shapes == inner
    assert all(matrix.dtype == np.float32 for matrix, _ in net.weights)


def test_the_skip_runs_from_the_third_to_the_last_hidden_layer(trained):
    net = trained[0]
    features = world(5, seed=5)[0]
    x = (features - net.feature_mean) / net.feature_scale
    for layer, (matrix, offset) in enumerate(net.weights[:-1]):
        x = np.maximum(x @ matrix + offset, 0.0)
        if layer == 2:
            third = x
    matrix, offset = net.weights[-1]
    scaled = 1.0 / (1.0 + np.exp(-((x + third) @ matrix + offset)[:, 0]))
    expected = net.low + (net.high - net.low) * scaled
    assert network.predict(net, features) == pytest.approx(expected, rel=1e-4)


def test_predictions_never_leave_the_scale_of_the_targets(trained):
    wild = np.array([[1e3] * 5, [-1e3] * 5, [0.0] * 5], np.float32)
    assert (
        (network.predict(trained[0], wild) >= 4) & (network.predict(trained[0], wild) <= 76)
    ).all()
    assert np.isnan(network.predict(trained[0], np.full((1, 5), np.nan)))


def test_a_seed_gives_the_same_weights_to_the_last_bit_and_another_gives_others():
    few = {**SMALL, "max_epochs": 3}
    runs = [network.train(*world(500), *world(100), seed=seed, **few)[0] for seed in (1, 1, 2)]
    first, again, other = (run.weights[0][0] for run in runs)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


SCRIPT = """
import os
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
from tests.unit.test_network import checksum
print(checksum())
"""


def checksum():
    """Of the weights of a full network after a few steps."""
    net, _ = network.train(*world(1024), *world(64), seed=1, max_epochs=1)
    return sum(matrix.astype(float).sum() for matrix, _ in net.weights).hex()


def test_the_number_of_cores_changes_no_bit():
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(["scripts", "."])}
    alone = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
    )
    assert alone.stdout.strip() == checksum()


def test_training_stops_when_the_validation_gets_no_better_and_keeps_the_best():
    features, _ = world(200)
    rng = np.random.default_rng(7)
    noise = rng.uniform(10, 70, 200)  # nothing to learn for these
    net, history = network.train(
        features,
        noise,
        *world(200, seed=8),
        seed=1,
        **{**SMALL, "patience": 3, "max_epochs": 200, "last_rate_share": 1.0},
    )
    assert len(history) < 200
    best = history["validation_loss"].idxmin()
    assert len(history) - 1 - best == 3
    prediction = network.predict(net, world(200, seed=8)[0])
    loss = np.mean(((prediction - world(200, seed=8)[1]) / 72) ** 2)
    assert loss == pytest.approx(history["validation_loss"].min(), rel=1e-3)


def test_a_network_is_written_and_read_whole(trained, tmp_path):
    network.write(tmp_path / "net.npz", trained[0])
    features = world(9)[0]
    again = network.read(tmp_path / "net.npz")
    assert np.array_equal(network.predict(trained[0], features), network.predict(again, features))


def test_a_split_keeps_parts_apart_and_holds_combinations_back_whole():
    combination = np.repeat(np.arange(20), 50)
    parts = network.split(combination, seed=1)
    everything = np.concatenate(list(parts.values()))
    assert np.array_equal(np.sort(everything), np.arange(1000))
    taught = set(combination[parts["train"]])
    assert taught.isdisjoint(combination[parts["validation"]])
    assert taught.isdisjoint(combination[parts["combinations"]])
    assert set(combination[parts["entries"]]) <= taught
    rest = len(parts["train"]) + len(parts["entries"])
    assert len(parts["entries"]) == round(0.2 * rest)
    with pytest.raises(InputError, match="3 or more"):
        network.split(np.zeros(10, int), seed=1)


def test_an_interval_holds_new_truths_as_often_as_asked():
    rng = np.random.default_rng(1)

    def draw(n):
        prediction = rng.uniform(0, 60, n)
        return prediction, np.full(n, 0.1), prediction + rng.normal(0, 1 + 0.1 * prediction)

    interval = intervals.fit(*draw(4000), level=0.9)
    prediction, spread, truth = draw(4000)
    low, high = intervals.bounds(interval, prediction, spread)
    assert intervals.coverage(low, high, truth) == pytest.approx(0.9, abs=0.02)
    # Errors grow with the prediction, so intervals do too: each end holds as many.
    for part in (prediction < 20, prediction > 40):
        held = intervals.coverage(low[part], high[part], truth[part])
        assert held == pytest.approx(0.9, abs=0.04)


def test_where_networks_disagree_the_interval_is_wider():
    n = np.arange(50.0)
    interval = intervals.fit(n, np.ones(50), n + 1, level=0.8)
    low, high = intervals.bounds(interval, np.array([5.0, 5.0]), np.array([0.0, 3.0]))
    assert (high - low)[1] > 2 * (high - low)[0]


def test_bands_beyond_those_that_taught_are_told():
    features, _ = world(6000)
    taught = intervals.training_range(features, seed=1, quantile=0.99)
    assert intervals.outside(taught, world(3000, seed=9)[0]).mean() == pytest.approx(0.01, abs=0.01)
    strange = features[:50] * np.array([1.0, 3.0, 1.0, 1.0, 1.0], np.float32)
    assert intervals.outside(taught, strange).all()
    assert intervals.outside(taught, np.full((1, 5), np.nan)).all()


def test_errors_have_the_deviations_that_were_asked_for():
    bright, dark = np.full((50_000, 5), 0.4, np.float32), np.zeros((50_000, 5), np.float32)
    noise = Noise(relative=0.03, relative_common=0.04, absolute=0.006, absolute_common=0.008)
    rng = np.random.default_rng(1)
    found = noise.add(dark, rng)
    assert found.std() == pytest.approx(0.01, rel=0.02)
    assert np.corrcoef(found[:, 0], found[:, 4])[0, 1] == pytest.approx(0.64, abs=0.02)
    # 0.4 × 0.05 beside 0.01
    assert noise.add(bright, rng).std() == pytest.approx(np.hypot(0.02, 0.01), rel=0.02)


def test_a_network_taught_with_errors_is_less_misled_by_them():
    fine = {**SMALL, "max_epochs": 40}
    noise = Noise(0.2, 0.0, 0.0, 0.0)
    features, target = world(2000, seed=5)
    disturbed = noise.add(features, np.random.default_rng(2))
    error = {}
    for name, errors in (("exact", None), ("robust", noise)):
        net, _ = network.train(*world(2000), *world(300, seed=2), seed=3, noise=errors, **fine)
        error[name] = np.sqrt(np.mean((network.predict(net, disturbed) - target) ** 2))
    assert error["robust"] < 0.8 * error["exact"]
