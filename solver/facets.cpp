// Kernels of the contact of facets with a rigid flat, see facets.hpp.
#include "facets.hpp"

#include "cell_flow.hpp"

#include <optional>

namespace asperity
{
namespace
{
/// Refuse a law or a displacement of other facets.
void expect_state(const Facets& facets, const ContactLaw& law, const Array<const double>& u, const History& committed,
                  const History& below)
{
  expect("height of the law", law.height, {facets.count(), facets.points()});
  expect("u", u, {at_least(facets.u_nodes), 3});
  committed.expect_shape("committed", facets.count(), facets.points());
  below.expect_shape("below", law.cells.count(), law.cells.points());
  expect("u_dofs of the cells", law.cells.u_dofs, {facets.count(), nodes});
}

double traction(const Sym& stress, const std::array<double, 3>& normal)
{
  return stress[4] * normal[0] + stress[5] * normal[1] + stress[2] * normal[2];
}

/// Derivative of the traction with respect to the nodal displacement.
Gradients traction_slope(const Tangent& C, const FacetPoint& p)
{
  std::array<double, 9> weights;
  for (int s = 0; s < 9; ++s)
    weights[s] = p.normal[0] * C[6][s] + p.normal[1] * C[7][s] + p.normal[2] * C[8][s];
  Gradients out;
  for (int a = 0; a < nodes; ++a)
    for (int k = 0; k < 3; ++k)
      out[a][k] = weights[3 * k] * p.g[a][0] + weights[3 * k + 1] * p.g[a][1] + weights[3 * k + 2] * p.g[a][2];
  return out;
}

/// The flow of the cell of a facet, and its derivatives if wanted.
struct FlowBelow
{
  CellFlow cell;
  CommonSlopes common;
  std::array<Gradients, most_points> dilatation; // derivatives of the volumetric strains of its points

  FlowBelow(const ContactLaw& law, std::size_t f, const Gradients& u, const History& committed, bool differentiate)
  {
    law.finite ? find<true>(law.material, law.cells, f, u, committed, differentiate)
               : find<false>(law.material, law.cells, f, u, committed, differentiate);
  }

private:
  template <bool finite>
  void find(const J2& material, const Cells& cells, std::size_t f, const Gradients& u, const History& committed,
            bool differentiate)
  {
    const CellResponse<finite> response(cells, f, material, committed, u);
    cell = response.flow;
    if (!differentiate || !cell.relaxes())
      return;
    response.at_points(
        [&](const Point& p, const auto& x, const auto& r)
        {
          dilatation[p.at] = {};
          if (!x.valid())
            return;
          common.add(material, cell, p, x, r);
          add_residual(p.g, x.nominal({1.0, 1.0, 1.0, 0.0, 0.0, 0.0}), 1.0, dilatation[p.at]);
        });
  }
};

double traction(const Matrix& P, const std::array<double, 3>& normal)
{
  return P[2][0] * normal[0] + P[2][1] * normal[1] + P[2][2] * normal[2];
}

/// Traction of the solid at a point, its derivative if wanted, and the new state.
struct Traction
{
  double t = 0.0;
  Gradients slope{};
  State state;

  Traction(const ContactLaw& law, const FacetPoint& p, const Gradients& u, const State& committed,
           const FlowBelow& below, const double* linear, bool differentiate)
      : state(committed)
  {
    // where strain is inside out t = 0; the cells reject such a state
    const auto at = [&](const auto& x)
    {
      if (x.valid())
        find(law.material, p, x, below, linear, differentiate);
    };
    law.finite ? at(FiniteStrain(p.g, u)) : at(SmallStrain(p.g, u));
  }

private:
  template <typename AnyStrain>
  void find(const J2& material, const FacetPoint& p, const AnyStrain& x, const FlowBelow& below, const double* linear,
            bool differentiate)
  {
    double permanent = 0.0;
    for (std::size_t q = 0; q < below.cell.points(); ++q)
      permanent += linear[q] * below.cell.permanent(q);
    const auto r = material.respond(material.trial(x.strain, state), trace(x.strain) - permanent, state,
                                    below.cell.relief);
    t = traction(x.nominal(r.stress), p.normal);
    if (differentiate)
    {
      slope = traction_slope(x.tangent(r.stress, material.tangent(r), r.direction), p);
      if (below.cell.relaxes())
        add_slope_below(material, p, x, r, below, linear);
    }
    state = r.state;
  }

  /// Add what follows from the flow of the cell: the traction of the change of its permanent volumetric strain and relief.
  template <typename AnyStrain>
  void add_slope_below(const J2& material, const FacetPoint& p, const AnyStrain& x, const J2::Response& r,
                       const FlowBelow& below, const double* linear)
  {
    const CellFlow& cell = below.cell;
    const double bulk = material.bulk() * traction(x.nominal({1.0, 1.0, 1.0, 0.0, 0.0, 0.0}), p.normal);
    const double relieved
        = r.plastic ? material.drive() / material.resistance() * traction(x.nominal(r.direction), p.normal) : 0.0;
    double deviation = 0.0;
    for (std::size_t q = 0; q < cell.points(); ++q)
      deviation += linear[q] * cell.deviation(q);
    const double kept = bulk * deviation;
    const Gradients of_flow
        = below.common.of_flow(material, cell, kept * cell.kept_slope, -relieved, kept * cell.kept_curvature);
    const double lost = bulk * (1.0 - cell.kept);
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
      {
        double permanent = -below.common.dilatation[a][i] / cell.volume;
        for (std::size_t q = 0; q < cell.points(); ++q)
          permanent += linear[q] * below.dilatation[q][a][i];
        slope[a][i] += of_flow[a][i] - lost * permanent;
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

Facets::Facets(Array<const double> x, Array<const int> x_dofs, Array<const int> u_dofs, Array<const int> local,
               Array<const double> gradients, Array<const double> shape, Array<const double> normals,
               Array<const double> weights)
    : x(x), x_dofs(x_dofs), u_dofs(u_dofs), local(local), gradients(gradients), shape(shape), normals(normals),
      weights(weights)
{
  expect("x", x, {any(), 3});
  expect("u_dofs", u_dofs, {any(), nodes});
  expect("x_dofs", x_dofs, {count(), nodes});
  expect("local", local, {count()});
  expect("weights", weights, {any()});
  expect("gradients", gradients, {4, points(), nodes, 3});
  expect("shape", shape, {4, points(), nodes});
  expect("normals", normals, {4, 3});
  check_range("x_dofs", x_dofs, x.shape(0));
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

void facet_weights(const Facets& facets, const Array<double>& out)
{
  expect("out", out, {facets.count(), facets.points()});
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const Gradients x = gather(facets.x.data(), facets.x_dofs.data() + nodes * f);
    for (std::size_t q = 0; q < facets.points(); ++q)
      out.data()[f * facets.points() + q] = FacetPoint(facets, x, f, q).weight;
  }
}

void facet_pressure(const Facets& facets, const ContactLaw& law, double z, const Array<const double>& u,
                    const History& committed, const History& below, const History& trial,
                    const Array<double>& pressure)
{
  expect_state(facets, law, u, committed, below);
  trial.expect_shape("trial", facets.count(), facets.points());
  expect("pressure", pressure, {facets.count(), facets.points()});
  const std::size_t points = facets.points();
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const Gradients x = gather(facets.x.data(), facets.x_dofs.data() + nodes * f);
    const Gradients uc = gather(u.data(), facets.dofs_of(f));
    const double g = law.stiffness.data()[f];
    std::optional<FlowBelow> flow;
    if (law.traction)
      flow.emplace(law, f, uc, below, false);
    for (std::size_t q = 0; q < points; ++q)
    {
      const std::size_t at = f * points + q;
      double excess = g * penetration(facets.shape_at(f, q), uc, z - law.height.data()[at]);
      if (law.traction)
      {
        const FacetPoint p(facets, x, f, q);
        const Traction body(law, p, uc, committed.at(at), *flow, law.linear_at(facets, f, q), false);
        trial.put(at, body.state);
        excess -= body.t;
      }
      pressure.data()[at] = std::max(excess, 0.0);
    }
  }
}

void facet_stiffness(const Facets& facets, const ContactLaw& law, const Array<const double>& u,
                     const History& committed, const History& below, const Array<const double>& pressure,
                     const BlockPattern& pattern, const Array<double>& values)
{
  expect_state(facets, law, u, committed, below);
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
    const Gradients x = gather(facets.x.data(), facets.x_dofs.data() + nodes * f);
    const Gradients uc = gather(u.data(), facets.dofs_of(f));
    const double g = law.stiffness.data()[f];
    std::optional<FlowBelow> flow;
    if (law.traction)
      flow.emplace(law, f, uc, below, true);
    for (std::size_t q = 0; q < points; ++q)
    {
      if (!(P[q] > 0.0))
        continue;
      const FacetPoint p(facets, x, f, q);
      const double* shape = facets.shape_at(f, q);
      Gradients slope{}, dP{};
      if (law.traction)
        slope = Traction(law, p, uc, committed.at(f * points + q), *flow, law.linear_at(facets, f, q), true).slope;
      for (int a = 0; a < nodes; ++a)
      {
        for (int j = 0; j < 3; ++j)
          dP[a][j] = -slope[a][j];
        dP[a][2] += g * shape[a];
      }
      for (int a = 0; a < nodes; ++a)
      {
        if (shape[a] == 0.0)
          continue;
        double* row = A + dof(a, 2) * row_length;
        for (int b = 0; b < nodes; ++b)
          for (int j = 0; j < 3; ++j)
            row[dof(b, j)] += p.weight * shape[a] * dP[b][j];
      }
    }
    pattern.add(facets.dofs_of(f), f, A, out);
  }
}
} // namespace asperity
