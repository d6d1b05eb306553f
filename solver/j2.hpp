// Radial return for J2 plasticity with linear isotropic hardening, in closed form.
//
// Simo & Hughes, Computational Inelasticity (1998), box 3.2 and Eq. (3.3.12); the readable twin is
// `asperity.model.material.return_map_ufl`. Symmetric tensors are stored as (xx, yy, zz, xy, xz, yz) with tensor
// (not engineering) shear components.
#pragma once

#include <array>
#include <cmath>

namespace asperity
{
using Sym = std::array<double, 6>;

/// Lame moduli, initial yield stress and plastic modulus H = E E_t/(E - E_t).
struct J2
{
  double lambda, mu, yield, hardening;
};

/// Stress, history increment and the coefficients of the consistent tangent
///   C = kappa 1x1 + 2 mu theta I_dev + chi n x n,   n = unit flow direction.
struct Response
{
  Sym stress, plastic_strain, direction;
  double alpha, theta, chi;
  bool plastic;
};

/// Contraction a:b of two symmetric tensors.
inline double contract(const Sym& a, const Sym& b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
}

/// Map the total strain and the committed history (plastic strain, accumulated plastic strain) to the response.
inline Response return_map(const J2& m, const Sym& strain, const double* plastic_strain, double alpha)
{
  Response r;
  const double trace = strain[0] + strain[1] + strain[2];
  const double pressure = (m.lambda + 2.0 * m.mu / 3.0) * trace;
  Sym s;
  for (int i = 0; i < 6; ++i)
    s[i] = 2.0 * m.mu * (strain[i] - (i < 3 ? trace / 3.0 : 0.0) - plastic_strain[i]);
  const double norm = std::sqrt(contract(s, s));
  const double q = std::sqrt(1.5) * norm;
  const double overstress = q - (m.yield + m.hardening * alpha);
  r.plastic = overstress > 0.0;
  const double dgamma = r.plastic ? overstress / (3.0 * m.mu + m.hardening) : 0.0;
  const double ratio = r.plastic ? dgamma / q : 0.0;
  r.theta = 1.0 - 3.0 * m.mu * ratio;
  r.chi = r.plastic ? 6.0 * m.mu * m.mu * (ratio - 1.0 / (3.0 * m.mu + m.hardening)) : 0.0;
  r.alpha = alpha + dgamma;
  for (int i = 0; i < 6; ++i)
  {
    r.direction[i] = r.plastic ? s[i] / norm : 0.0;
    r.plastic_strain[i] = plastic_strain[i] + 1.5 * ratio * s[i];
    r.stress[i] = r.theta * s[i] + (i < 3 ? pressure : 0.0);
  }
  return r;
}
} // namespace asperity
