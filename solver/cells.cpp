// Kernels over cells, see cells.hpp. Each has one loop over cells and one over their quadrature points; those that depend
// on the strain are compiled for small and finite ones.
#include "cells.hpp"
#include "cell_flow.hpp"

#include <algorithm>
#include <type_traits>

namespace asperity
{
namespace
{
/// Add the symmetric element matrix of a cell to the values: `fill(A)` adds to its upper triangle.
template <typename Pattern, typename Fill>
void add_cell(const Cells& cells, std::size_t c, const Pattern& pattern, typename Pattern::Value* values, Fill fill)
{
  double A[dofs * row_length] = {};
  pattern.prefetch(cells.dofs_of(c), c, values);
  fill(A);
  for (int r = 1; r < dofs; ++r)
    for (int s = 0; s < r; ++s)
      A[r * row_length + s] = A[s * row_length + r];
  pattern.add(cells.dofs_of(c), c, A, values);
}

/// Call `kernel(finite)` with the kind of strain as a constant.
template <typename Kernel>
void with_kind(bool finite, Kernel&& kernel)
{
  if (finite)
    kernel(std::true_type{});
  else
    kernel(std::false_type{});
}

} // namespace

Cells::Cells(Array<const double> x, Array<const int> x_dofs, Array<const int> u_dofs, Array<const double> gradients,
             Array<const double> weights, double spent, double threshold)
    : x(x), x_dofs(x_dofs), u_dofs(u_dofs), gradients(gradients), weights(weights),
      relaxation{spent, threshold}
{
  expect("x", x, {any(), 3});
  expect("x_dofs", x_dofs, {any(), nodes});
  expect("u_dofs", u_dofs, {count(), nodes});
  expect("weights", weights, {any()});
  expect("gradients", gradients, {points(), nodes, 3});
  check_range("x_dofs", x_dofs, x.shape(0));
  u_nodes = check_range("u_dofs", u_dofs, most_nodes);
}

History::History(Array<double> plastic_strain, Array<double> accumulated, Array<double> dilatation)
    : plastic_strain(plastic_strain), accumulated(accumulated), dilatation(dilatation)
{
  expect("plastic_strain", plastic_strain, {any(), any(), 6});
  expect("accumulated", accumulated, {plastic_strain.shape(0), plastic_strain.shape(1)});
  expect("dilatation", dilatation, {plastic_strain.shape(0), plastic_strain.shape(1)});
}

void History::expect_shape(const char* name, std::size_t rows, std::size_t points) const
{
  if (!empty())
    expect((std::string("plastic strain of ") + name).c_str(), plastic_strain, {rows, points, 6});
}

std::pair<std::int64_t, std::int64_t> residual(const Cells& cells, const J2& law, bool finite,
                                               const Array<const double>& u, const History& committed,
                                               const History& trial, const Array<bool>& plastic,
                                               const Array<double>& b)
{
  cells.expect_nodal("u", u);
  committed.expect_shape("committed", cells.count(), cells.points());
  trial.expect_shape("trial", cells.count(), cells.points());
  expect("plastic", plastic, {cells.count()});
  cells.expect_nodal("b", b);
  std::int64_t total = 0, inverted = 0;
  with_kind(finite,
            [&](auto kind)
            {
              for (std::size_t c = 0; c < cells.count(); ++c)
              {
                const CellResponse<kind()> cell(cells, c, law, committed, gather(u.data(), cells.dofs_of(c)));
                Gradients f{};
                int flowing = 0;
                cell.at_points(
                    [&](const Point& p, const auto& x, const auto& r)
                    {
                      trial.put(p.index, x.valid() ? r.state : committed.at(p.index));
                      if (!x.valid())
                        ++inverted;
                      else
                        add_residual(p.g, x.nominal(r.stress), p.volume, f);
                      flowing += r.plastic;
                    });
                plastic.data()[c] = flowing > 0;
                total += flowing;
                scatter(f, cells.dofs_of(c), b.data());
              }
            });
  return {total, inverted};
}

template <typename Pattern>
void stiffness_elastic(const Cells& cells, const J2& law, const Pattern& pattern,
                       const Array<typename Pattern::Value>& values)
{
  auto* out = pattern.start(values, cells.count());
  const Tangent tangent = nominal_tangent(law.elastic(), {});
  for (std::size_t c = 0; c < cells.count(); ++c)
    add_cell(cells, c, pattern, out,
             [&](double* A)
             {
               const Gradients x = cells.corners(c);
               for (std::size_t q = 0; q < cells.points(); ++q)
               {
                 const Point p = cells.point(c, q, x);
                 add_stiffness(p.g, tangent, p.volume, A);
               }
             });
}

template <typename Pattern>
void stiffness_consistent(const Cells& cells, const J2& law, bool finite, const Array<const double>& u,
                          const History& committed, const Array<const bool>& marked, const Pattern& pattern,
                          const Array<typename Pattern::Value>& values)
{
  cells.expect_nodal("u", u);
  committed.expect_shape("committed", cells.count(), cells.points());
  expect("marked", marked, {cells.count()});
  auto* out = pattern.start(values, cells.count());
  with_kind(finite,
            [&](auto kind)
            {
              for (std::size_t c = 0; c < cells.count(); ++c)
              {
                if (!marked.data()[c])
                  continue;
                const CellResponse<kind()> cell(cells, c, law, committed, gather(u.data(), cells.dofs_of(c)));
                const auto fill = [&](double* A)
                {
                  CommonSlopes common;
                  cell.at_points(
                      [&](const Point& p, const auto& x, const auto& r)
                      {
                        if (!x.valid())
                          return;
                        const Moduli moduli = cell.relaxed(kind() ? law.tangent(r) : law.softening(r));
                        if (kind() || r.plastic || cell.flow.kept < 1.0)
                          add_stiffness(p.g, x.tangent(r.stress, moduli, r.direction), p.volume, A);
                        if (cell.flow.relaxes())
                          common.add(law, cell.flow, p, x, r);
                      });
                  if (cell.flow.relaxes())
                    common.add_to(law, cell.flow, A);
                };
                add_cell(cells, c, pattern, out, fill);
              }
            });
}

template void stiffness_elastic(const Cells&, const J2&, const BlockPattern&, const Array<double>&);
template void stiffness_elastic(const Cells&, const J2&, const HalfPattern&, const Array<float>&);
template void stiffness_consistent(const Cells&, const J2&, bool, const Array<const double>&, const History&,
                                   const Array<const bool>&, const BlockPattern&, const Array<double>&);
template void stiffness_consistent(const Cells&, const J2&, bool, const Array<const double>&, const History&,
                                   const Array<const bool>&, const HalfPattern&, const Array<float>&);

void stress(const Cells& cells, const J2& law, bool finite, bool conjugate, const Array<const double>& u,
            const History& committed, const Array<double>& out)
{
  cells.expect_nodal("u", u);
  committed.expect_shape("committed", cells.count(), cells.points());
  expect("out", out, {cells.count(), cells.points(), 6});
  with_kind(finite,
            [&](auto kind)
            {
              for (std::size_t c = 0; c < cells.count(); ++c)
              {
                const CellResponse<kind()> cell(cells, c, law, committed, gather(u.data(), cells.dofs_of(c)));
                cell.at_points(
                    [&](const Point& p, const auto& x, const auto& r)
                    {
                      const Sym s = !x.valid() ? Sym{} : conjugate ? r.stress : x.cauchy(r.stress);
                      std::copy_n(s.begin(), 6, out.data() + 6 * p.index);
                    });
              }
            });
}
} // namespace asperity
