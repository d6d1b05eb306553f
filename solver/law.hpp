// Interface of a material law to the kernels: its parameters, the response to a strain, and the tangent.
//
// A law is a header like elastic.hpp and j2.hpp that satisfies the concept `MaterialLaw`. The list in laws.hpp names it,
// module.cpp binds its parameters as a class, and all kernels over cells and facets take it from there.
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

/// A law: the response to a total strain from the committed state, and what it makes of the stiffness. It begins with the
/// trial state, that without flow; the response takes its own volumetric strain and a relief of the yield stress.
template <typename Law>
concept MaterialLaw
    = requires(const Law& law, const Sym& strain, const State& committed, const typename Law::Trial& trial,
               const typename Law::Response& r, double dilatation, double relief) {
        { law.trial(strain, committed) } -> std::same_as<typename Law::Trial>;
        { law.respond(trial, dilatation, committed, relief) } -> std::same_as<typename Law::Response>;
        { r.stress } -> std::convertible_to<Sym>;
        { r.state } -> std::convertible_to<State>;
        { r.plastic } -> std::convertible_to<bool>;  // whether the state changes
        { r.direction } -> std::convertible_to<Sym>; // n of the tangent
        { law.elastic() } -> std::same_as<Moduli>;
        { law.tangent(r) } -> std::same_as<Moduli>;   // the consistent tangent
        { law.softening(r) } -> std::same_as<Moduli>; // the same less the elastic stiffness
      };

/// A law with a plastic strain that keeps the volume.
template <typename Law>
concept FlowLaw = MaterialLaw<Law> && requires(const Law& law, const typename Law::Trial& trial) {
  { trial.excess } -> std::convertible_to<double>; // of the stress over the yield stress
  { law.resistance() } -> std::same_as<double>;    // by which it falls with the plastic strain
  { law.drive() } -> std::same_as<double>;         // by which it rises with the strain along n
};
} // namespace asperity
