// Kernels of the contact of facets with a rigid flat, see facets.hpp.
#include "facets.hpp"

#include "cell_flow.hpp"

#include <optional>

namespace asperity
{
namespace
{
/// Refuse a law or a displacement of other facets.
void expect_state(const Facets& facets, const ContactLaw& law, const Array<const double>& u, const History& below)
{
  expect("height of the law", law.height, {facets.count(), facets.points()});
  expect("u", u, {at_least(facets.u_nodes), 3});
  below.expect_shape("below", law.cells.count(), law.cells.points());
  expect("u_dofs of the cells", law.cells.u_dofs, {facets.count(), nodes});
}

using Vector = std::array<double, 3>;

/// Row z of a stress.
Vector row_z(const Sym& stress)
{
  return {stress[4], stress[5], stress[2]};
}
Vector row_z(const Matrix& P)
{
  return P[2];
}

/// The z components of the nominal stress at the points of a cell, and their derivatives if wanted.
struct StressBelow
{
  std::array<Vector, most_points> stress{}; // where the strain is inside out zero; the cells reject such a state
  std::array<std::array<Gradients, 3>, most_points> slope{};

  StressBelow(const ContactLaw& law, std::size_t f, const Gradients& u, const History& committed, bool differentiate)
  {
    law.finite ? find<true>(law, f, u, committed, differentiate) : find<false>(law, f, u, committed, differentiate);
  }

private:
  template <bool finite>
  void find(const ContactLaw& law, std::size_t f, const Gradients& u, const History& committed, bool differentiate)
  {
    const CellResponse<finite> cell(law.cells, f, law.material, committed, u);
    CommonSlopes common;
    const bool relaxes = differentiate && cell.flow.relaxes();
    if (relaxes)
      cell.at_points(
          [&](const Point& p, const auto& x, const auto& r)
          {
            if (x.valid())
              common.add(law.material, cell.flow, p, x, r);
          });
    cell.at_points(
        [&](const Point& p, const auto& x, const auto& r)
        {
          if (!x.valid())
            return;
          stress[p.at] = row_z(x.nominal(r.stress));
          if (!differentiate)
            return;
          add_slope(x.tangent(r.stress, cell.relaxed(law.material.tangent(r)), r.direction), p);
          if (relaxes)
            add_common_slope(law.material, cell.flow, common, p, x, r);
        });
  }

  /// Add what follows from the strain of the point itself.
  void add_slope(const Tangent& C, const Point& p)
  {
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < nodes; ++a)
        for (int k = 0; k < 3; ++k)
          for (int l = 0; l < 3; ++l)
            slope[p.at][i][a][k] += C[6 + i][3 * k + l] * p.g[a][l];
  }

  /// Add what follows from the mean of the cell and from its flow, which changes permanent volumetric strain and relief.
  template <typename AnyStrain>
  void add_common_slope(const J2& material, const CellFlow& cell, const CommonSlopes& common, const Point& p,
                        const AnyStrain& x, const J2::Response& r)
  {
    const Vector unit = row_z(x.nominal(Sym{1.0, 1.0, 1.0, 0.0, 0.0, 0.0})), flow = row_z(x.nominal(r.direction));
    const double relieved = r.plastic ? material.drive() / material.resistance() : 0.0;
    const double mean = (1.0 - cell.kept) / cell.volume;
    for (int i = 0; i < 3; ++i)
    {
      const double bulk = material.bulk() * unit[i], own = bulk * cell.deviation(p.at);
      const Gradients of_flow = common.of_flow(material, cell, own * cell.kept_slope, -relieved * flow[i],
                                               own * cell.kept_curvature);
      for (int a = 0; a < nodes; ++a)
        for (int k = 0; k < 3; ++k)
          slope[p.at][i][a][k] += of_flow[a][k] + bulk * mean * common.dilatation[a][k];
    }
  }
};

double penetration(const double* shape, const Gradients& u, double gap)
{
  double d = -gap;
  for (int a = 0; a < nodes; ++a)
    d += shape[a] * u[a][2];
  return d;
}

} // namespace

Facets::Facets(Array<const int> u_dofs, Array<const int> local, Array<const double> shape, Array<const double> normals,
               Array<const double> weights)
    : u_dofs(u_dofs), local(local), shape(shape), normals(normals), weights(weights)
{
  expect("u_dofs", u_dofs, {any(), nodes});
  expect("local", local, {count()});
  expect("weights", weights, {count(), any()});
  expect("shape", shape, {4, points(), nodes});
  expect("normals", normals, {count(), points(), 3});
  u_nodes = check_range("u_dofs", u_dofs, most_nodes);
  check_range("local", local, 4);
}

ContactLaw::ContactLaw(const J2& material, bool finite, Array<const double> stiffness, Array<const double> height,
                       bool traction, const Cells& cells, Array<const double> linear)
    : material(material), finite(finite), stiffness(stiffness), height(height), traction(traction), cells(cells),
      linear(linear)
{
  expect("stiffness", stiffness, {any()});
  expect("height", height, {stiffness.shape(0), any()});
  expect("linear", linear, {4, height.shape(1), cells.points()});
}

void facet_pressure(const Facets& facets, const ContactLaw& law, double z, const Array<const double>& u,
                    const History& below, const Array<double>& pressure)
{
  expect_state(facets, law, u, below);
  expect("pressure", pressure, {facets.count(), facets.points()});
  const std::size_t points = facets.points();
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const Gradients uc = gather(u.data(), facets.dofs_of(f));
    const double g = law.stiffness.data()[f];
    std::optional<StressBelow> body;
    if (law.traction)
      body.emplace(law, f, uc, below, false);
    for (std::size_t q = 0; q < points; ++q)
    {
      const std::size_t at = f * points + q;
      double excess = g * penetration(facets.shape_at(f, q), uc, z - law.height.data()[at]);
      if (law.traction)
      {
        const double *normal = facets.normals.data() + 3 * at, *share = law.linear_at(facets, f, q);
        for (std::size_t c = 0; c < law.cells.points(); ++c)
          for (int i = 0; i < 3; ++i)
            excess -= share[c] * normal[i] * body->stress[c][i];
      }
      pressure.data()[at] = std::max(excess, 0.0);
    }
  }
}

void facet_stiffness(const Facets& facets, const ContactLaw& law, const Array<const double>& u, const History& below,
                     const Array<const double>& pressure, const BlockPattern& pattern, const Array<double>& values)
{
  expect_state(facets, law, u, below);
  expect("pressure", pressure, {facets.count(), facets.points()});
  double* out = pattern.start(values, facets.count());
  const std::size_t points = facets.points();
  double A[dofs * row_length];
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const double* P = pressure.data() + f * points;
    if (std::none_of(P, P + points, [](double p) { return p > 0.0; }))
      continue;
    std::fill_n(A, dofs * row_length, 0.0);
    const double g = law.stiffness.data()[f];
    std::optional<StressBelow> body;
    if (law.traction)
      body.emplace(law, f, gather(u.data(), facets.dofs_of(f)), below, true);
    for (std::size_t q = 0; q < points; ++q)
    {
      if (!(P[q] > 0.0))
        continue;
      const std::size_t at = f * points + q;
      const double *normal = facets.normals.data() + 3 * at, weight = facets.weights.data()[at];
      const double *shape = facets.shape_at(f, q), *share = law.linear_at(facets, f, q);
      Gradients dP{};
      for (int a = 0; a < nodes; ++a)
        dP[a][2] = g * shape[a];
      if (law.traction)
        for (std::size_t c = 0; c < law.cells.points(); ++c)
          for (int i = 0; i < 3; ++i)
            for (int a = 0; a < nodes; ++a)
              for (int j = 0; j < 3; ++j)
                dP[a][j] -= share[c] * normal[i] * body->slope[c][i][a][j];
      for (int a = 0; a < nodes; ++a)
      {
        if (shape[a] == 0.0)
          continue;
        double* row = A + dof(a, 2) * row_length;
        for (int b = 0; b < nodes; ++b)
          for (int j = 0; j < 3; ++j)
            row[dof(b, j)] += weight * shape[a] * dP[b][j];
      }
    }
    pattern.add(facets.dofs_of(f), f, A, out);
  }
}
} // namespace asperity
