// Interface of a material law to the kernels. A law is a header like elastic.hpp and j2.hpp: its parameters, the State
// of a point, and the response to a strain. The kernels of cells.cpp are templates over the law, module.cpp
// binds its parameters as a class and its kernels.
//
// Symmetric tensors are stored as (xx, yy, zz, xy, xz, yz) with tensor (not engineering) shear components.
#pragma once

#include <array>
#include <concepts>

namespace asperity
{
using Sym = std::array<double, 6>;

/// Contraction a:b of two symmetric tensors.
inline double contract(const Sym& a, const Sym& b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
}

/// Coefficients of a stiffness C = lambda 1x1 + 2 mu I + chi n x n with a unit direction n.
struct Moduli
{
  double lambda, mu, chi;
};

/// A law of small strains: the response to a total strain from the committed state.
template <typename Law>
concept SmallStrainLaw = requires(const Law& law, const Sym& strain, const typename Law::State& committed) {
  { law.respond(strain, committed).stress } -> std::convertible_to<Sym>;
  { law.respond(strain, committed).state } -> std::convertible_to<typename Law::State>;
  { law.respond(strain, committed).plastic } -> std::convertible_to<bool>;
};
} // namespace asperity
