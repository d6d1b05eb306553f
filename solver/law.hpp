// Tensors and the state of a point, which the law of the material (j2.hpp) and the kernels share.
//
// Symmetric tensors are stored as (xx, yy, zz, xy, xz, yz) with tensor (not engineering) shear components.
#pragma once

#include <array>

namespace asperity
{
using Sym = std::array<double, 6>;

/// Contraction a:b of two symmetric tensors.
inline double contract(const Sym& a, const Sym& b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
}

inline double trace(const Sym& a)
{
  return a[0] + a[1] + a[2];
}

/// Coefficients of a stiffness C = lambda 1x1 + 2 mu I + chi n x n with a unit direction n.
struct Moduli
{
  double lambda, mu, chi;
};

/// Internal variables of a point, zero in the virgin material.
struct State
{
  Sym plastic_strain{};
  double accumulated = 0.0; // plastic strain
  double dilatation = 0.0;  // volumetric strain that flow has made permanent, see relaxation.hpp
};
} // namespace asperity
