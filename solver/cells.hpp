// Kernels over cells: internal force, stiffness, stress. Those of a cell that flows know of all its points, see
// relaxation.hpp.
#pragma once

#include "arrays.hpp"
#include "j2.hpp"
#include "patterns.hpp"
#include "relaxation.hpp"

#include <cstdint>
#include <utility>

namespace asperity
{
/// A quadrature point in a cell: its number there and among those of all cells, gradients of the shape functions,
/// volume.
struct Point
{
  std::size_t at, index;
  Gradients g;
  double volume;
};

/// Cells with one quadrature rule: geometry, dofs, tabulated basis.
struct Cells
{
  Array<const double> x;         // node coordinates (n, 3)
  Array<const int> x_dofs;       // (cells, nodes)
  Array<const int> u_dofs;       // (cells, nodes)
  Array<const double> gradients; // reference gradients at the points (points, nodes, 3)
  Array<const double> weights;   // quadrature weights on the reference cell (points)
  Relaxation relaxation;         // of volumetric strain
  std::size_t u_nodes;           // least number of nodes of a nodal array

  Cells(Array<const double> x, Array<const int> x_dofs, Array<const int> u_dofs, Array<const double> gradients,
        Array<const double> weights, double spent, double threshold);

  std::size_t count() const { return x_dofs.shape(0); }
  std::size_t points() const { return weights.shape(0); }
  const int* dofs_of(std::size_t c) const { return u_dofs.data() + nodes * c; }

  Gradients corners(std::size_t c) const { return gather(x.data(), x_dofs.data() + nodes * c); }

  /// A point of a cell from its `corners`.
  Point point(std::size_t c, std::size_t q, const Gradients& corners) const
  {
    Point p{q, c * points() + q, {}, 0.0};
    p.volume = push_forward(gradients.data() + dofs * q, corners, p.g) * weights.data()[q];
    return p;
  }

  /// Refuse nodal values (nodes, 3) of fewer nodes than the cells have.
  template <typename T>
  void expect_nodal(const char* name, const Array<T>& values) const
  {
    expect(name, values, {at_least(u_nodes), 3});
  }
};

/// Committed or trial history of a solid: plastic strain (rows, points, 6), accumulated and permanent volumetric strain
/// (rows, points), a row per cell or facet. Without rows it is that of a virgin material and nothing is written. The class History of
/// asperity.fem.history has the same variables.
struct History
{
  Array<double> plastic_strain, accumulated, dilatation;

  History(Array<double> plastic_strain, Array<double> accumulated, Array<double> dilatation);

  bool empty() const { return accumulated.shape(0) == 0; }

  /// Refuse a history that is not empty and has another shape.
  void expect_shape(const char* name, std::size_t rows, std::size_t points) const;

  State at(std::size_t index) const
  {
    State state;
    if (empty())
      return state;
    std::copy_n(plastic_strain.data() + 6 * index, 6, state.plastic_strain.begin());
    state.accumulated = accumulated.data()[index];
    state.dilatation = dilatation.data()[index];
    return state;
  }
  void put(std::size_t index, const State& state) const
  {
    if (empty())
      return;
    std::copy_n(state.plastic_strain.begin(), 6, plastic_strain.data() + 6 * index);
    accumulated.data()[index] = state.accumulated;
    dilatation.data()[index] = state.dilatation;
  }
};

/// Add the internal force of the displacement `u` (nodes, 3) to `b` (nodes, 3), of small or `finite` strain. The same
/// pass writes the trial history and `plastic` (cells), whether any point of a cell flows. Returns the number of points that
/// flow, and of those where finite strain turns the solid inside out; these add nothing.
std::pair<std::int64_t, std::int64_t> residual(const Cells& cells, const J2& law, bool finite,
                                               const Array<const double>& u, const History& committed,
                                               const History& trial, const Array<bool>& plastic,
                                               const Array<double>& b);

/// Add the elastic stiffness of all cells to the values of the matrix.
template <typename Pattern>
void stiffness_elastic(const Cells& cells, const J2& law, const Pattern& pattern,
                       const Array<typename Pattern::Value>& values);

/// Add the consistent tangent of the `marked` cells (cells), in small strain less the elastic stiffness.
template <typename Pattern>
void stiffness_consistent(const Cells& cells, const J2& law, bool finite, const Array<const double>& u,
                          const History& committed, const Array<const bool>& marked, const Pattern& pattern,
                          const Array<typename Pattern::Value>& values);

/// Stress at the quadrature points, out (cells, points, 6). Of finite strain: Cauchy's, or if `conjugate` that whose
/// work per undeformed volume is done on the logarithmic strain.
void stress(const Cells& cells, const J2& law, bool finite, bool conjugate, const Array<const double>& u,
            const History& committed, const Array<double>& out);
} // namespace asperity
