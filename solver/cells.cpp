// Kernels over cells, see cells.hpp. Each has one loop over cells and one over their quadrature points, the latter in
// `Cells::at_points`; those that depend on the material are compiled for each law, see laws.hpp.
#include "cells.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace asperity
{
namespace
{
/// Mean over a cell of its gradients, which the variation of its mean volumetric strain takes, and its volume.
struct MeanGradients
{
  Gradients sum{};
  double volume = 0.0;

  void add(const Gradients& g, double weight)
  {
    volume += weight;
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        sum[a][i] += weight * g[a][i];
  }

  /// Add the stiffness against the mean volumetric strain.
  void add_stiffness(double bulk_modulus, double* A) const
  {
    if (bulk_modulus > 0.0 && volume > 0.0)
      asperity::add_stiffness(sum, nominal_tangent({bulk_modulus, 0.0, 0.0}, {}), 1.0 / volume, A);
  }
};

/// Add the symmetric element matrix of a cell to the values: `at_point(p, A)` adds the part of a quadrature point to its
/// upper triangle, `at_end(A)` that of the whole cell.
template <typename Pattern, typename AtPoint, typename AtEnd>
void add_cell(const Cells& cells, std::size_t c, const Pattern& pattern, typename Pattern::Value* values,
              AtPoint at_point, AtEnd at_end)
{
  double A[dofs * row_length] = {};
  pattern.prefetch(cells.dofs_of(c), c, values);
  cells.at_points(c, [&](const Point& p) { at_point(p, A); });
  at_end(A);
  for (int r = 1; r < dofs; ++r)
    for (int s = 0; s < r; ++s)
      A[r * row_length + s] = A[s * row_length + r];
  pattern.add(cells.dofs_of(c), c, A, values);
}

/// Volumetric strain that all points of a cell have; none where each has its own.
using Dilatation = std::optional<double>;

/// Whether all points of a cell have the same one: after the step in which the plastic strain of any exceeds the limit.
bool takes_mean(const Cells& cells, std::size_t c, const History& committed)
{
  if (committed.empty())
    return false;
  const double* first = committed.accumulated.data() + c * cells.points();
  return std::any_of(first, first + cells.points(), [&](double accumulated) { return accumulated > cells.mean_beyond; });
}

/// Mean of `measure(p)` over the points of a cell that takes it.
template <typename Measure>
Dilatation mean_of(const Cells& cells, std::size_t c, const History& committed, Measure measure)
{
  if (!takes_mean(cells, c, committed))
    return {};
  double sum = 0.0, volume = 0.0;
  cells.at_points(c,
                  [&](const Point& p)
                  {
                    sum += p.volume * measure(p);
                    volume += p.volume;
                  });
  return sum / volume;
}

Dilatation small_dilatation(const Cells& cells, std::size_t c, const History& committed, const Gradients& u)
{
  return mean_of(cells, c, committed, [&](const Point& p) { return trace(strain(p.g, u)); });
}

/// Of the points that are not inside out.
Dilatation finite_dilatation(const Cells& cells, std::size_t c, const History& committed, const Gradients& u)
{
  return mean_of(cells, c, committed,
                 [&](const Point& p)
                 {
                   const Deformation deformation(p.g, u);
                   return deformation.valid() ? std::log(deformation.det) : 0.0;
                 });
}

/// The strain with the volumetric one of its cell.
Sym dilated(Sym strain, const Dilatation& dilatation)
{
  if (dilatation)
  {
    const double change = (*dilatation - trace(strain)) / 3.0;
    for (int i = 0; i < 3; ++i)
      strain[i] += change;
  }
  return strain;
}

/// Bulk modulus against the mean volumetric strain of a cell that takes it; 0 where each point has its own.
template <typename Law>
double bulk_modulus(const Law& law, const Dilatation& dilatation)
{
  const Moduli C = law.elastic();
  return dilatation ? C.lambda + 2.0 / 3.0 * C.mu : 0.0;
}
} // namespace

Cells::Cells(Array<const double> x, Array<const int> x_dofs, Array<const int> u_dofs, Array<const double> gradients,
             Array<const double> weights, double mean_beyond)
    : x(x), x_dofs(x_dofs), u_dofs(u_dofs), gradients(gradients), weights(weights), mean_beyond(mean_beyond)
{
  expect("x", x, {any(), 3});
  expect("x_dofs", x_dofs, {any(), nodes});
  expect("u_dofs", u_dofs, {count(), nodes});
  expect("weights", weights, {any()});
  expect("gradients", gradients, {points(), nodes, 3});
  check_range("x_dofs", x_dofs, x.shape(0));
  u_nodes = check_range("u_dofs", u_dofs, most_nodes);
}

History::History(Array<double> plastic_strain, Array<double> accumulated)
    : plastic_strain(plastic_strain), accumulated(accumulated)
{
  expect("plastic_strain", plastic_strain, {any(), any(), 6});
  expect("accumulated", accumulated, {plastic_strain.shape(0), plastic_strain.shape(1)});
}

void History::expect_shape(const char* name, std::size_t rows, std::size_t points) const
{
  if (!empty())
    expect((std::string("plastic strain of ") + name).c_str(), plastic_strain, {rows, points, 6});
}

void volumes(const Cells& cells, const Array<double>& out)
{
  expect("out", out, {cells.count(), cells.points()});
  for (std::size_t c = 0; c < cells.count(); ++c)
    cells.at_points(c, [&](const Point& p) { out.data()[p.index] = p.volume; });
}

void min_jacobian(const Cells& cells, const Array<double>& out)
{
  expect("out", out, {cells.count()});
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    double smallest = 1e300;
    cells.at_points(c, [&](const Point& p) { smallest = std::min(smallest, p.det); });
    out.data()[c] = smallest;
  }
}

std::pair<std::int64_t, std::int64_t> residual(const Cells& cells, const Law& law, bool finite,
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
  // `at(material, p, uc, dilatation, f)` adds the force of a point and returns whether it flows
  const auto all_cells = [&](const auto& material, auto dilatation_of, auto at)
  {
    for (std::size_t c = 0; c < cells.count(); ++c)
    {
      const Gradients uc = gather(u.data(), cells.dofs_of(c));
      const Dilatation dilatation = dilatation_of(cells, c, committed, uc);
      Gradients f{};
      int flowing = 0;
      cells.at_points(c, [&](const Point& p) { flowing += at(material, p, uc, dilatation, f); });
      plastic.data()[c] = flowing > 0 || dilatation.has_value();
      total += flowing;
      scatter(f, cells.dofs_of(c), b.data());
    }
  };
  const auto small_strain
      = [&](const auto& material, const Point& p, const Gradients& uc, const Dilatation& dilatation, Gradients& f)
  {
    const auto r = material.respond(dilated(strain(p.g, uc), dilatation), committed.at(p.index));
    trial.put(p.index, r.state);
    add_residual(p.g, r.stress, p.volume, f);
    return r.plastic;
  };
  const auto finite_strain
      = [&](const auto& material, const Point& p, const Gradients& uc, const Dilatation& dilatation, Gradients& f)
  {
    const Deformation deformation(p.g, uc);
    const State state = committed.at(p.index);
    if (!deformation.valid())
    {
      trial.put(p.index, state);
      ++inverted;
      return false;
    }
    return with_log_strain(deformation,
                           [&](const auto& x)
                           {
                             const auto r = material.respond(dilated(x.strain, dilatation), state);
                             trial.put(p.index, r.state);
                             add_residual(p.g, x.nominal(r.stress), p.volume, f);
                             return r.plastic;
                           });
  };
  with_law(law,
           [&](const auto& material)
           {
             finite ? all_cells(material, finite_dilatation, finite_strain)
                    : all_cells(material, small_dilatation, small_strain);
           });
  return {total, inverted};
}

template <typename Pattern>
void stiffness_elastic(const Cells& cells, const Law& law, const Pattern& pattern,
                       const Array<typename Pattern::Value>& values)
{
  auto* out = pattern.start(values, cells.count());
  const Tangent tangent = nominal_tangent(with_law(law, [](const auto& material) { return material.elastic(); }), {});
  for (std::size_t c = 0; c < cells.count(); ++c)
    add_cell(
        cells, c, pattern, out, [&](const Point& p, double* A) { add_stiffness(p.g, tangent, p.volume, A); },
        [](double*) {});
}

template <typename Pattern>
void stiffness_plastic(const Cells& cells, const Law& law, const Array<const double>& u, const History& committed,
                       const Array<const bool>& plastic, const Pattern& pattern,
                       const Array<typename Pattern::Value>& values)
{
  cells.expect_nodal("u", u);
  committed.expect_shape("committed", cells.count(), cells.points());
  expect("plastic", plastic, {cells.count()});
  auto* out = pattern.start(values, cells.count());
  with_law(law,
           [&](const auto& material)
           {
             for (std::size_t c = 0; c < cells.count(); ++c)
             {
               if (!plastic.data()[c])
                 continue;
               const Gradients uc = gather(u.data(), cells.dofs_of(c));
               const Dilatation dilatation = small_dilatation(cells, c, committed, uc);
               const double bulk = bulk_modulus(material, dilatation);
               MeanGradients mean;
               const auto at_point = [&](const Point& p, double* A)
               {
                 const auto r = material.respond(dilated(strain(p.g, uc), dilatation), committed.at(p.index));
                 Moduli moduli = r.plastic ? material.softening(r) : Moduli{};
                 moduli.lambda -= bulk;
                 if (r.plastic || bulk > 0.0)
                   add_stiffness(p.g, nominal_tangent(moduli, r.direction), p.volume, A);
                 if (bulk > 0.0)
                   mean.add(p.g, p.volume);
               };
               add_cell(cells, c, pattern, out, at_point, [&](double* A) { mean.add_stiffness(bulk, A); });
             }
           });
}

template <typename Pattern>
void stiffness_finite(const Cells& cells, const Law& law, const Array<const double>& u, const History& committed,
                      const Pattern& pattern, const Array<typename Pattern::Value>& values)
{
  cells.expect_nodal("u", u);
  committed.expect_shape("committed", cells.count(), cells.points());
  auto* out = pattern.start(values, cells.count());
  with_law(law,
           [&](const auto& material)
           {
             for (std::size_t c = 0; c < cells.count(); ++c)
             {
               const Gradients uc = gather(u.data(), cells.dofs_of(c));
               const Dilatation dilatation = finite_dilatation(cells, c, committed, uc);
               const double bulk = bulk_modulus(material, dilatation);
               MeanGradients mean;
               const auto at_point = [&](const Point& p, double* A)
               {
                 const Deformation deformation(p.g, uc);
                 if (!deformation.valid())
                   return;
                 with_log_strain(deformation,
                                 [&](const auto& x)
                                 {
                                   const auto r = material.respond(dilated(x.strain, dilatation), committed.at(p.index));
                                   Moduli moduli = material.tangent(r);
                                   moduli.lambda -= bulk;
                                   add_stiffness(p.g, x.tangent(r.stress, moduli, r.direction), p.volume, A);
                                 });
                 if (bulk > 0.0)
                   mean.add(deformed(p.g, deformation), p.volume);
               };
               add_cell(cells, c, pattern, out, at_point, [&](double* A) { mean.add_stiffness(bulk, A); });
             }
           });
}

template void stiffness_elastic(const Cells&, const Law&, const BlockPattern&, const Array<double>&);
template void stiffness_elastic(const Cells&, const Law&, const HalfPattern&, const Array<float>&);
template void stiffness_plastic(const Cells&, const Law&, const Array<const double>&, const History&,
                                const Array<const bool>&, const BlockPattern&, const Array<double>&);
template void stiffness_plastic(const Cells&, const Law&, const Array<const double>&, const History&,
                                const Array<const bool>&, const HalfPattern&, const Array<float>&);
template void stiffness_finite(const Cells&, const Law&, const Array<const double>&, const History&,
                               const BlockPattern&, const Array<double>&);
template void stiffness_finite(const Cells&, const Law&, const Array<const double>&, const History&,
                               const HalfPattern&, const Array<float>&);

void stress(const Cells& cells, const Law& law, bool finite, bool conjugate, const Array<const double>& u,
            const History& committed, const Array<double>& out)
{
  cells.expect_nodal("u", u);
  committed.expect_shape("committed", cells.count(), cells.points());
  expect("out", out, {cells.count(), cells.points(), 6});
  const auto at_point
      = [&](const auto& material, const Point& p, const Gradients& uc, const Dilatation& dilatation) -> Sym
  {
    const State state = committed.at(p.index);
    if (!finite)
      return material.respond(dilated(strain(p.g, uc), dilatation), state).stress;
    const Deformation deformation(p.g, uc);
    if (!deformation.valid())
      return {};
    const LogStrain x(deformation);
    const Sym T = material.respond(dilated(x.strain, dilatation), state).stress;
    return conjugate ? T : x.cauchy(T);
  };
  with_law(law,
           [&](const auto& material)
           {
             for (std::size_t c = 0; c < cells.count(); ++c)
             {
               const Gradients uc = gather(u.data(), cells.dofs_of(c));
               const Dilatation dilatation
                   = finite ? finite_dilatation(cells, c, committed, uc) : small_dilatation(cells, c, committed, uc);
               cells.at_points(c,
                               [&](const Point& p)
                               {
                                 const Sym s = at_point(material, p, uc, dilatation);
                                 std::copy_n(s.begin(), 6, out.data() + 6 * p.index);
                               });
             }
           });
}
} // namespace asperity
