// Response of the points of a cell that flow together, see relaxation.hpp, and its derivatives.
#pragma once

#include "cells.hpp"
#include "log_strain.hpp"

#include <optional>
#include <stdexcept>
#include <string>

namespace asperity
{
/// Strain and response of the points of a cell to the displacement of its nodes.
template <bool finite>
class CellResponse
{
public:
  CellFlow flow; // of all points

  CellResponse(const Cells& cells, std::size_t c, const J2& material, const History& committed, const Gradients& u)
      : material(material), committed(committed), count(cells.points())
  {
    if (count > most_points)
      throw std::invalid_argument("weights has more than " + std::to_string(most_points) + " points");
    const Gradients corners = cells.corners(c);
    for (std::size_t q = 0; q < count; ++q)
    {
      auto& [p, x, trial] = points[q].emplace(cells, c, q, corners, u);
      const State state = committed.at(p.index);
      trial = material.trial(x.strain, state);
      flow.add(trace(x.strain), state.dilatation, trial.excess, x.valid() ? p.volume : 0.0);
    }
    flow.solve(material.resistance(), material.bulk(), cells.relaxation);
  }

  /// Call `kernel` with point, strain and response; the latter is void where the strain is not valid.
  template <typename Kernel>
  void at_points(Kernel kernel) const
  {
    for (std::size_t q = 0; q < count; ++q)
    {
      const Entry& at = *points[q];
      kernel(at.p, at.x, at.x.valid() ? respond(at) : J2::Response{});
    }
  }

  /// Moduli of a point without the part of the bulk modulus that the cell does not keep.
  Moduli relaxed(Moduli moduli) const
  {
    moduli.lambda -= (1.0 - flow.kept) * material.bulk();
    return moduli;
  }

private:
  struct Entry
  {
    Point p;
    Strain<finite> x;
    J2::Trial trial;

    Entry(const Cells& cells, std::size_t c, std::size_t q, const Gradients& corners, const Gradients& u)
        : p(cells.point(c, q, corners)), x(p.g, u)
    {
    }
  };

  J2::Response respond(const Entry& at) const
  {
    const double permanent = flow.permanent(at.p.at);
    auto r = material.respond(at.trial, trace(at.x.strain) - permanent, committed.at(at.p.index), flow.relief);
    r.state.dilatation = permanent;
    return r;
  }

  const J2& material;
  const History& committed;
  std::size_t count;
  std::array<std::optional<Entry>, most_points> points;
};

/// Derivatives, with respect to the displacement, of what the points of a cell have in common.
struct CommonSlopes
{
  Gradients dilatation{}, deviation{}, driving{}; // of mean volumetric strain, D^2/2, and flow at a given relief; times V

  template <typename AnyStrain>
  void add(const J2& material, const CellFlow& cell, const Point& p, const AnyStrain& x, const J2::Response& r)
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
  void add_to(const J2& material, const CellFlow& cell, double* A) const
  {
    const double bulk = material.bulk(), slope = bulk * cell.kept_slope;
    const double slopes = material.secant ? 0.0 : 1.0 / cell.volume;
    const double share = slopes / (1.0 - cell.softness * cell.relief_slope);
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
    const double curvature = slope != 0.0 ? slopes * bulk * cell.kept_curvature / (slope * slope) : 0.0;
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
  Gradients of_flow(const J2& material, const CellFlow& cell, double flow, double relief, double deviated) const
  {
    const double slope = material.bulk() * cell.kept_slope;
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
