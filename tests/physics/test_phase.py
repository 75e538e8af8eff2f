"""Leaves with spherical angles scatter by a phase function with a closed form."""

import numpy as np
import pytest

from dapple import engine
from dapple.scene.mitsuba_plugins import register
from dapple.scene.patterns import cosine_hemisphere
from dapple.scene.phase import (
    phase_function,
    quantile_argument,
    reflected_cumulative,
    reflected_quantile_table,
)

RHO, TAU = (0.3, 0.1, 0.05), (0.1, 0.3, 0.0)


@pytest.fixture(scope="module")
def mi():
    mitsuba = engine.load("llvm_ad_rgb")
    register()
    return mitsuba


def plugin(mi, kind):
    colours = {"reflectance": mi.ScalarColor3f(RHO), "transmittance": mi.ScalarColor3f(TAU)}
    return mi.load_dict({"type": kind, **colours})


def scattered_by_drawn_leaves(rng, n, reflectance, transmittance):
    """Cosines between the way in (straight down) and the way out, leaf by leaf."""
    normal = cosine_hemisphere(rng.random((n, 2)))  # facing the light, weighted by projection
    lobe = cosine_hemisphere(rng.random((n, 2)))
    across = np.cross(normal, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    out = across * lobe[:, :1] + along * lobe[:, 1:2] + normal * lobe[:, 2:]
    reflected = rng.random(n) < reflectance / (reflectance + transmittance)
    return -np.where(reflected, out[:, 2], -out[:, 2])


@pytest.mark.parametrize(("rho", "tau"), [(1.0, 0.0), (0.0, 1.0), (0.08, 0.05)])
def test_the_phase_function_holds_all_scattered_light(rho, tau):
    angle = (np.arange(20000) + 0.5) * np.pi / 20000
    density = phase_function(angle, rho, tau) * 2.0 * np.pi * np.sin(angle)
    assert density.sum() * np.pi / 20000 == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize(("rho", "tau"), [(1.0, 0.0), (0.0, 1.0), (0.3, 0.1)])
def test_the_closed_form_is_what_leaves_drawn_one_by_one_do(rho, tau):
    n, edges = 400_000, np.linspace(-1.0, 1.0, 21)
    cosine = scattered_by_drawn_leaves(np.random.default_rng(3), n, rho, tau)
    found = np.histogram(cosine, edges)[0] / n
    fine = np.linspace(-1.0, 1.0, 20 * 500 + 1)
    middle = 0.5 * (fine[1:] + fine[:-1])
    density = 2.0 * np.pi * phase_function(np.arccos(middle), rho, tau) * np.diff(fine)
    expected = density.reshape(20, 500).sum(axis=1)
    sigma = np.sqrt(expected * (1.0 - expected) / n)
    assert (np.abs(found - expected) < 4.5 * sigma).all()


def test_reflection_goes_back_and_transmission_goes_on():
    back, on = np.pi, 0.0
    assert phase_function(on, 1.0, 0.0) == pytest.approx(0.0)
    assert phase_function(back, 1.0, 0.0) == pytest.approx(2.0 / (3.0 * np.pi))
    assert phase_function(back, 0.0, 1.0) == pytest.approx(0.0)


def test_the_quantile_table_inverts_the_cumulative():
    table = reflected_quantile_table()
    angle = np.linspace(0.0, np.pi, 1001)
    argument = quantile_argument(np.clip(reflected_cumulative(angle), 0.0, 1.0))
    back = np.interp(argument, np.linspace(0.0, 1.0, len(table)), table)
    # near 0 the closed form of the cumulative loses digits, not the table
    assert np.abs(back - angle)[angle > 0.05].max() < 1e-4


def test_mitsuba_samples_the_phase_function_that_it_evaluates(mi):
    phase, n = plugin(mi, "leaf_phase"), 200_000
    rng = np.random.default_rng(5)
    way_in = np.array([0.48, -0.6, 0.64])
    mei = mi.MediumInteraction3f()
    mei.wi = mi.Vector3f(*(-way_in).tolist())
    u = rng.random((3, n)).astype(np.float32)
    wo, weight, pdf = phase.sample(
        mi.PhaseFunctionContext(None), mei, mi.Float(u[0]), mi.Point2f(u[1:])
    )
    cosine = np.clip(way_in @ np.array(wo), -1.0, 1.0)
    rho, tau = np.mean(RHO), np.mean(TAU)
    assert np.allclose(pdf, phase_function(np.arccos(cosine), rho, tau), rtol=1e-3, atol=1e-5)
    assert np.array(weight).mean(axis=1) == pytest.approx(1.0, abs=0.01)
    drawn = scattered_by_drawn_leaves(rng, n, rho, tau)
    found, expected = (np.histogram(x, 20, (-1.0, 1.0))[0] for x in (cosine, drawn))
    assert (np.abs(found - expected) < 5.0 * np.sqrt(found + expected)).all()


def test_a_leaf_scatters_its_reflectance_to_one_side_and_its_transmittance_to_the_other(mi):
    leaf, n = plugin(mi, "bilambertian"), 100_000
    rng = np.random.default_rng(7)
    u = rng.random((3, n)).astype(np.float32)
    for height in (0.6, -0.6):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(0.8, 0.0, height)
        bs, weight = leaf.sample(mi.BSDFContext(), si, mi.Float(u[0]), mi.Point2f(u[1:]))
        back = np.array(bs.wo)[2] * height > 0.0
        weight = np.array(weight)
        assert weight[:, back].sum(axis=1) / n == pytest.approx(RHO, abs=0.003)
        assert weight[:, ~back].sum(axis=1) / n == pytest.approx(TAU, abs=0.003)
        value, pdf = leaf.eval_pdf(mi.BSDFContext(), si, bs.wo)
        assert np.allclose(np.array(value) / np.array(pdf), weight, rtol=1e-4, atol=1e-6)
        assert np.allclose(pdf, bs.pdf, rtol=1e-4)
