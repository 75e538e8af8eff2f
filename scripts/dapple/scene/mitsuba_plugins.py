"""What Mitsuba lacks: leaves that reflect and transmit diffusely, and a medium of such leaves."""

from functools import cache
from typing import Any

import drjit as dr
import mitsuba
import numpy as np

from dapple.scene.phase import NORM, reflected_quantile_table


def register() -> None:
    """Make `bilambertian`, `painted` and `leaf_phase` known to the active variant, once each."""
    _register(mitsuba.variant())


@cache
def _register(variant: str) -> None:
    mitsuba.register_bsdf("bilambertian", _leaf_class(variant))
    mitsuba.register_bsdf("painted", _painted_class(variant))
    mitsuba.register_phase("leaf_phase", _phase_class(variant))


def _split(reflectance, transmittance):
    """Share of scattered light that is reflected, over the bands; a half for black leaves."""
    scattered = dr.mean(reflectance + transmittance)
    return dr.select(scattered > 0.0, dr.mean(reflectance) / scattered, 0.5)


@cache
def _leaf_class(variant: str) -> type:
    mi: Any = mitsuba

    class BiLambertian(mi.BSDF):
        """Both faces reflect `reflectance` and transmit `transmittance`, both as cosine lobes."""

        def __init__(self, props):
            super().__init__(props)
            self.reflectance = mi.Color3f(props["reflectance"])
            self.transmittance = mi.Color3f(props["transmittance"])
            self.reflected_share = _split(self.reflectance, self.transmittance)
            dr.make_opaque(self.reflectance, self.transmittance, self.reflected_share)
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [
                mi.BSDFFlags.DiffuseReflection | sides,
                mi.BSDFFlags.DiffuseTransmission | sides,
            ]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def traverse(self, callback):
            for name in ("reflectance", "transmittance"):
                callback.put(name, getattr(self, name), +mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys):
            self.reflected_share = _split(self.reflectance, self.transmittance)
            dr.make_opaque(self.reflectance, self.transmittance, self.reflected_share)

        def optics(self, si, active):
            """Reflectance, transmittance, and the chance that scattered light is reflected."""
            return self.reflectance, self.transmittance, self.reflected_share

        def sample(self, ctx, si, sample1, sample2, active=True):
            reflectance, transmittance, share = self.optics(si, active)
            lobe = mi.warp.square_to_cosine_hemisphere(sample2)
            lit_side = dr.mulsign(lobe, mi.Frame3f.cos_theta(si.wi))
            reflected = sample1 < share
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo = dr.select(reflected, lit_side, -lit_side)
            density = dr.select(reflected, share, 1.0 - share)
            bs.pdf = density * mi.warp.square_to_cosine_hemisphere_pdf(lobe)
            bs.eta = 1.0
            bs.sampled_type = dr.select(
                reflected,
                mi.UInt32(+mi.BSDFFlags.DiffuseReflection),
                mi.UInt32(+mi.BSDFFlags.DiffuseTransmission),
            )
            bs.sampled_component = dr.select(reflected, mi.UInt32(0), mi.UInt32(1))
            weight = dr.select(reflected, reflectance, transmittance) / density
            return bs, weight & (active & (bs.pdf > 0.0))

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx, si, wo, active=True):
            reflectance, transmittance, share = self.optics(si, active)
            towards, away = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            lobe = dr.abs(away) * dr.inv_pi
            reflected = towards * away > 0.0
            value = dr.select(reflected, reflectance, transmittance) * lobe
            share = dr.select(reflected, share, 1.0 - share)
            return value & active, dr.select(active, share * lobe, 0.0)

        def to_string(self):
            return "BiLambertian[]"

    return BiLambertian


def _painted_class(variant: str) -> type:
    mi: Any = mitsuba

    leaf_class: Any = _leaf_class(variant)

    class Painted(leaf_class):
        """Bi-Lambertian like `bilambertian`, but every triangle of a mesh has its own material."""

        def __init__(self, props):
            props["reflectance"] = props["transmittance"] = mi.ScalarColor3f(0.0)
            super().__init__(props)
            # A kernel is made for all scenes that are alive, those not yet painted too.
            self.assign(np.zeros(1, np.uint32))
            self.paint(*np.zeros((2, 1, 3), np.float32))

        def assign(self, of_face):
            """Give each triangle (t,) the number of its material."""
            self.of_face = mi.UInt32(of_face)

        def paint(self, reflectance, transmittance):
            """Give each material (m, 3) its colours."""
            self.colours = [mi.Float(x.ravel()) for x in (reflectance, transmittance)]

        def optics(self, si, active):
            material = dr.gather(mi.UInt32, self.of_face, si.prim_index, active)
            both = [dr.gather(mi.Color3f, table, material, active) for table in self.colours]
            return *both, _split(*both)

        def to_string(self):
            return "Painted[]"

    return Painted


def _phase_class(variant: str) -> type:
    mi: Any = mitsuba

    class LeafPhase(mi.PhaseFunction):
        """Phase function of `dapple.scene.phase`, with a reflected share of its own in each band.

        The medium's albedo has to be reflectance + transmittance.
        """

        def __init__(self, props):
            super().__init__(props)
            reflectance = mi.Color3f(props["reflectance"])
            transmittance = mi.Color3f(props["transmittance"])
            self.reflected_share = _split(reflectance, transmittance)
            scattered = reflectance + transmittance
            self.band_share = dr.select(scattered > 0.0, reflectance / scattered, 0.5)
            dr.make_opaque(self.reflected_share, self.band_share)
            self.angle = mi.Float(reflected_quantile_table())
            self.m_flags = +mi.PhaseFunctionFlags.Anisotropic

        def _value_pdf(self, wo, wi):
            straight = dr.clip(-dr.dot(wo, wi), -1.0, 1.0)
            sine, angle = dr.sqrt(1.0 - dr.square(straight)), dr.acos(straight)
            back = NORM * (sine - angle * straight)
            ahead = NORM * (sine + (dr.pi - angle) * straight)
            value = self.band_share * back + (1.0 - self.band_share) * ahead
            return value, dr.lerp(ahead, back, self.reflected_share)

        def sample(self, ctx, mei, sample1, sample2, active=True):
            argument = 1.0 - dr.sqrt(1.0 - dr.power(sample2.x, 0.2))
            place = argument * (dr.width(self.angle) - 1)
            node = dr.minimum(mi.UInt32(place), dr.width(self.angle) - 2)
            low = dr.gather(mi.Float, self.angle, node, active)
            high = dr.gather(mi.Float, self.angle, node + 1, active)
            angle = dr.lerp(low, high, place - mi.Float(node))
            angle = dr.select(sample1 < self.reflected_share, angle, dr.pi - angle)
            sine, cosine = dr.sincos(angle)
            sine_turn, cosine_turn = dr.sincos(dr.two_pi * sample2.y)
            local = mi.Vector3f(sine * cosine_turn, sine * sine_turn, cosine)
            wo = mi.Frame3f(-mei.wi).to_world(local)
            value, pdf = self._value_pdf(wo, mei.wi)
            return wo, value / pdf & (active & (pdf > 0.0)), pdf

        def eval_pdf(self, ctx, mei, wo, active=True):
            value, pdf = self._value_pdf(wo, mei.wi)
            return value & active, dr.select(active, pdf, 0.0)

        def to_string(self):
            return "LeafPhase[]"

    return LeafPhase
