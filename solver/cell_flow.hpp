// Response of the points of a cell that flow together, see relaxation.hpp, and its derivatives.
#pragma once

#include "cells.hpp"
#include "log_strain.hpp"

#include <optional>
#include <stdexcept>
#include <string>

namespace asperity
{
template <MaterialLaw L>
double bulk_modulus(const L& law)
{
  const Moduli C = law.elastic();
  return C.lambda + 2.0 / 3.0 * C.mu;
}

/// The strain with another volumetric one.
inline Sym dilated(Sym strain, double change)
{
  for (int i = 0; i < 3; ++i)
    strain[i] += change / 3.0;
  return strain;
}

/// Strain and response of the points of a cell to the displacement of its nodes.
template <bool finite, MaterialLaw L>
class CellResponse
{
public:
  CellFlow flow; // of all points; of a law without flow nothing

  CellResponse(const Cells& cells, std::size_t c, const L& material, const History& committed, const Gradients& u)
  {
    if (cells.points() > most_points)
      throw std::invalid_argument("weights has more than " + std::to_string(most_points) + " points");
    cells.at_points(c,
                    [&](const Point& p)
                    {
                      auto& at = points[count++].emplace(p, u, committed);
                      if (at.x.valid())
                        at.r = material.respond(dilated(at.x.strain, -at.state.dilatation), at.state);
                      if constexpr (FlowLaw<L>)
                        flow.add(trace(at.x.strain), at.state.dilatation, at.r.excess, at.x.valid() ? p.volume : 0.0);
                    });
    if constexpr (FlowLaw<L>)
      settle(material, cells.relaxation);
  }

  /// Call `kernel` with point, strain and response; the latter is void where the strain is not valid.
  template <typename Kernel>
  void at_points(Kernel kernel) const
  {
    for (std::size_t q = 0; q < count; ++q)
      kernel(Point{q, points[q]->index, points[q]->g, points[q]->det, points[q]->volume}, points[q]->x, points[q]->r);
  }

private:
  struct Entry
  {
    std::size_t index;
    double det, volume;
    Gradients g;
    Strain<finite> x;
    State state; // committed
    typename L::Response r{};

    Entry(const Point& p, const Gradients& u, const History& committed)
        : index(p.index), det(p.det), volume(p.volume), g(p.g), x(p.g, u), state(committed.at(p.index))
    {
    }
  };
  std::size_t count = 0;
  std::array<std::optional<Entry>, most_points> points;

  /// Find the flow, and what it makes of the responses.
  void settle(const L& material, const Relaxation& relaxation)
  {
    const double bulk = bulk_modulus(material);
    flow.solve(material.resistance(), bulk, relaxation);
    for (std::size_t q = 0; q < count; ++q)
    {
      Entry& at = *points[q];
      const double permanent = flow.permanent(q);
      if (flow.relief > 0.0 && at.r.excess + flow.relief > 0.0)
        at.r = material.respond(dilated(at.x.strain, -permanent), at.state, flow.relief);
      else
        for (int i = 0; i < 3; ++i)
          at.r.stress[i] -= bulk * (permanent - at.state.dilatation);
      at.r.state.dilatation = permanent;
    }
  }
};

/// Derivatives, with respect to the displacement, of what the points of a cell have in common.
struct CommonSlopes
{
  Gradients dilatation{}, deviation{}, driving{}; // of mean volumetric strain, D^2/2, and flow at a given relief; times V

  template <typename L, typename AnyStrain, typename Response>
  void add(const L& material, const CellFlow& cell, const Point& p, const AnyStrain& x, const Response& r)
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
        row[1][dof(a, i)] = slope * deviation[a][i];
        row[2][dof(a, i)] = driving[a][i];
      }
    const double mean = bulk * (1.0 - cell.kept) / cell.volume;
    // where the slope of `kept` vanishes, so does its curvature
    const double curvature = slope != 0.0 ? bulk * cell.kept_curvature / (cell.volume * slope * slope) : 0.0;
    for (int r = 0; r < dofs; ++r)
    {
      const double x = mean * row[0][r];
      const double y = share * (row[2][r] - cell.softness * row[1][r]) + curvature * row[1][r];
      const double z = share * (row[1][r] - cell.relief_slope * row[2][r]);
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
