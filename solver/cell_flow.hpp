// Response of the points of a cell that flow together, see relaxation.hpp, and its derivatives.
#pragma once

#include "cells.hpp"

namespace asperity
{
/// Strain of a point in small strain, with the members of the forms of log_strain.hpp.
struct SmallStrain
{
  Sym strain;

  const Sym& nominal(const Sym& stress) const { return stress; }
  Tangent tangent(const Sym&, const Moduli& C, const Sym& n) const { return nominal_tangent(C, n); }
};

/// Call `kernel(x)` with the strain of a point; returns false where it is inside out, without a call.
template <bool finite, typename Kernel>
bool with_strain(const Gradients& g, const Gradients& u, Kernel&& kernel)
{
  if constexpr (finite)
  {
    const Deformation deformation(g, u);
    if (!deformation.valid())
      return false;
    with_log_strain(deformation, kernel);
  }
  else
    kernel(SmallStrain{strain(g, u)});
  return true;
}

template <MaterialLaw L>
double bulk_modulus(const L& law)
{
  const Moduli C = law.elastic();
  return C.lambda + 2.0 / 3.0 * C.mu;
}

/// The flow of a cell, and the volumetric strains of its points; of a law without flow nothing.
template <bool finite, MaterialLaw L>
CellFlow flow_of(const CellPoints& points, const Relaxation& relaxation, const L& material, const History& committed,
                 const Gradients& u)
{
  CellFlow out;
  if constexpr (FlowLaw<L>)
  {
    points.at_points(
        [&](const Point& p)
        {
          const State state = committed.at(p.index);
          const auto at = [&](const auto& x)
          { out.add(trace(x.strain), state.dilatation, material.respond(x.strain, state).excess, p.volume); };
          if (!with_strain<finite>(p.g, u, at))
            out.add(0.0, 0.0, -1.0, 0.0);
        });
    out.solve(material.resistance(), material.strength(), bulk_modulus(material), relaxation);
  }
  return out;
}

/// The strain with another volumetric one.
inline Sym dilated(Sym strain, double change)
{
  for (int i = 0; i < 3; ++i)
    strain[i] += change / 3.0;
  return strain;
}

/// Response of a point of a cell.
template <MaterialLaw L>
typename L::Response respond(const L& material, const CellFlow& cell, std::size_t at, const Sym& strain,
                             const State& committed)
{
  if constexpr (FlowLaw<L>)
  {
    auto r = material.respond(dilated(strain, -cell.permanent(at)), committed, cell.relief);
    r.state.dilatation = cell.permanent(at);
    return r;
  }
  else
    return material.respond(strain, committed);
}

/// Derivatives, with respect to the displacement, of what the points of a cell have in common.
struct CommonSlopes
{
  Gradients dilatation{}, deviation{}, driving{}; // of mean volumetric strain, D^2/2, and flow at a given relief; times V

  template <typename L, typename Strain, typename Response>
  void add(const L& material, const CellFlow& cell, const Point& p, const Strain& x, const Response& r)
  {
    constexpr Sym one{1.0, 1.0, 1.0, 0.0, 0.0, 0.0};
    Gradients g{};
    add_residual(p.g, x.nominal(one), p.volume, g);
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
      {
        dilatation[a][i] += g[a][i];
        deviation[a][i] += cell.deviation(p.at) * g[a][i];
      }
    if (r.plastic)
      add_residual(p.g, x.nominal(r.direction), p.volume * material.drive() / material.resistance(), driving);
  }

  /// Add to the stiffness what a point does not have from its own strain.
  template <typename L>
  void add_to(const L& material, const CellFlow& cell, double* A) const
  {
    const double bulk = bulk_modulus(material), slope = bulk * cell.kept_slope;
    const double share = 1.0 / (cell.volume * (1.0 - cell.softness * cell.relief_slope));
    double row[3][row_length] = {}; // by the order `dof`
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
      {
        row[0][dof(a, i)] = dilatation[a][i];
        row[1][dof(a, i)] = deviation[a][i];
        row[2][dof(a, i)] = driving[a][i];
      }
    const double mean = bulk * (1.0 - cell.kept) / cell.volume;
    const double curvature = bulk * cell.kept_curvature / cell.volume;
    for (int r = 0; r < dofs; ++r)
    {
      const double x = mean * row[0][r];
      const double y = slope * share * (row[2][r] - cell.softness * slope * row[1][r]) + curvature * row[1][r];
      const double z = share * (slope * row[1][r] - cell.relief_slope * row[2][r]);
      for (int s = r; s < dofs; ++s)
        A[r * row_length + s] += x * row[0][s] + y * row[1][s] + z * row[2][s];
    }
  }

  /// Derivative of flow * `flow` + relief * `relief` + D^2/2 * `deviated` of a cell.
  template <typename L>
  Gradients of_flow(const L& material, const CellFlow& cell, double flow, double relief, double deviated) const
  {
    const double slope = bulk_modulus(material) * cell.kept_slope;
    const double share = 1.0 / (cell.volume * (1.0 - cell.softness * cell.relief_slope));
    const double driven = share * (flow + cell.relief_slope * relief);
    deviated = deviated / cell.volume - share * slope * (cell.softness * flow + relief);
    Gradients out;
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        out[a][i] = driven * driving[a][i] + deviated * deviation[a][i];
    return out;
  }
};
} // namespace asperity
