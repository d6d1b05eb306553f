// The law of the kernels: radial return for J2 plasticity with linear hardening, isotropic, kinematic or mixed, in closed
// form. An elastic material has an infinite yield stress, and no history. Another law is one in UFL.
//
// Prager's rule: the share beta of the hardening moves the centre of the yield surface to the back stress
// 2/3 beta H eps_p, the rest increases its size to yield + (1 - beta) H alpha. Simo & Hughes, Computational Inelasticity
// (1998), box 3.2 and Eq. (3.3.12), whose multiplier keeps the denominator 3 mu + H for any share; the readable twin is
// in python/asperity/laws/shipped.py.
#pragma once

#include "law.hpp"

#include <cmath>

namespace asperity
{
struct J2
{
  static constexpr double rounding = 4e-14; // of the yield stress
  double lambda, mu;       // Lame moduli [force/length^2]
  double yield, hardening; // initial yield stress and plastic modulus H = E E_t/(E - E_t) [force/length^2]
  double kinematic_share;  // beta, in [0, 1]
  bool secant = false;     // whether the stiffness is that of the chords: stress over strain, without the slopes of flow

  double back_modulus() const { return 2.0 / 3.0 * kinematic_share * hardening; } // back stress over plastic strain

  struct Response
  {
    Sym stress, direction; // the unit direction of flow
    State state;
    double theta, chi; // of the stiffness kappa 1x1 + 2 mu theta I_dev + chi n x n
    bool plastic;
  };

  /// Deviator of the trial stress less the back stress, its Mises stress, and the excess of that over the yield stress.
  struct Trial
  {
    Sym s;
    double q, excess;
  };

  Trial trial(const Sym& strain, const State& committed) const
  {
    Trial out;
    const double mean = trace(strain) / 3.0, back = back_modulus();
    for (int i = 0; i < 6; ++i)
      out.s[i] = 2.0 * mu * (strain[i] - (i < 3 ? mean : 0.0) - committed.plastic_strain[i])
                 - back * committed.plastic_strain[i];
    out.q = std::sqrt(1.5 * contract(out.s, out.s));
    // a state that flowed and stays is on the yield surface, where rounding decides: it is elastic
    out.excess = out.q - (1.0 + rounding) * (yield + (1.0 - kinematic_share) * hardening * committed.accumulated);
    return out;
  }

  /// Args: the trial state, the volumetric strain that is not permanent, the committed state, the relief of the yield
  /// stress (relaxation.hpp)
  Response respond(const Trial& trial, double dilatation, const State& committed, double relief) const
  {
    Response r;
    const auto& [s, q, excess] = trial;
    const double pressure = bulk() * dilatation, back = back_modulus();
    const double overstress = excess + relief;
    r.plastic = overstress > 0.0 && q > 0.0;
    const double dgamma = r.plastic ? overstress / (3.0 * mu + hardening) : 0.0;
    const double ratio = r.plastic ? dgamma / q : 0.0, unit = r.plastic ? std::sqrt(1.5) / q : 0.0;
    r.theta = 1.0 - 3.0 * mu * ratio;
    r.chi = r.plastic && !secant ? 6.0 * mu * mu * (ratio - 1.0 / (3.0 * mu + hardening)) : 0.0;
    r.state.accumulated = committed.accumulated + dgamma;
    for (int i = 0; i < 6; ++i)
    {
      r.direction[i] = unit * s[i];
      r.state.plastic_strain[i] = committed.plastic_strain[i] + 1.5 * ratio * s[i];
      r.stress[i] = r.theta * s[i] + (back * committed.plastic_strain[i] + (i < 3 ? pressure : 0.0));
    }
    return r;
  }

  Moduli elastic() const { return {lambda, mu, 0.0}; }
  double bulk() const { return lambda + 2.0 * mu / 3.0; }
  double resistance() const { return 3.0 * mu + hardening; } // by which the excess falls with the plastic strain
  double drive() const { return std::sqrt(6.0) * mu; }       // by which it rises with the strain along the direction

  /// The consistent tangent, or the secant stiffness.
  Moduli tangent(const Response& r) const { return {lambda + 2.0 / 3.0 * mu * (1.0 - r.theta), mu * r.theta, r.chi}; }

  /// The same less the elastic stiffness.
  Moduli softening(const Response& r) const { return {2.0 / 3.0 * mu * (1.0 - r.theta), mu * (r.theta - 1.0), r.chi}; }
};
} // namespace asperity
