// Kernels of the contact of facets with a rigid flat, see facets.hpp.
#include "facets.hpp"

namespace asperity
{
namespace
{
/// Refuse a law or a displacement of other facets.
void expect_state(const Facets& facets, const ContactLaw& law, const Array<const double>& u, const History& committed)
{
  expect("height of the law", law.height, {facets.count(), facets.points()});
  expect("u", u, {at_least(facets.u_nodes), 3});
  committed.expect_shape("committed", facets.count(), facets.points());
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

/// Traction of the solid at a point, its derivative if wanted, and the new state.
struct Traction
{
  double t = 0.0;
  Gradients slope{};
  State state;

  Traction(const ContactLaw& law, const FacetPoint& p, const Gradients& u, const State& committed, bool differentiate)
      : state(committed)
  {
    with_law(law.material, [&](const auto& material)
             { law.finite ? of_finite(material, p, u, differentiate) : of_small(material, p, u, differentiate); });
  }

private:
  template <MaterialLaw L>
  void of_small(const L& material, const FacetPoint& p, const Gradients& u, bool differentiate)
  {
    const auto r = material.respond(strain(p.g, u), state);
    t = traction(r.stress, p.normal);
    if (differentiate)
      slope = traction_slope(nominal_tangent(material.tangent(r), r.direction), p);
    state = r.state;
  }

  template <MaterialLaw L>
  void of_finite(const L& material, const FacetPoint& p, const Gradients& u, bool differentiate)
  {
    const Deformation deformation(p.g, u);
    if (!deformation.valid()) // t = 0; the cells reject such a state
      return;
    with_log_strain(deformation,
                    [&](const auto& x)
                    {
                      const auto r = material.respond(x.strain, state);
                      const Matrix P = x.nominal(r.stress);
                      t = P[2][0] * p.normal[0] + P[2][1] * p.normal[1] + P[2][2] * p.normal[2];
                      if (differentiate)
                        slope = traction_slope(x.tangent(r.stress, material.tangent(r), r.direction), p);
                      state = r.state;
                    });
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

ContactLaw::ContactLaw(const Law& material, bool finite, Array<const double> stiffness, Array<const double> height,
                       bool traction)
    : material(material), finite(finite), stiffness(stiffness), height(height), traction(traction)
{
  expect("stiffness", stiffness, {any()});
  expect("height", height, {stiffness.shape(0), any()});
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
                    const History& committed, const History& trial, const Array<double>& pressure)
{
  expect_state(facets, law, u, committed);
  trial.expect_shape("trial", facets.count(), facets.points());
  expect("pressure", pressure, {facets.count(), facets.points()});
  const std::size_t points = facets.points();
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const Gradients x = gather(facets.x.data(), facets.x_dofs.data() + nodes * f);
    const Gradients uc = gather(u.data(), facets.dofs_of(f));
    const double g = law.stiffness.data()[f];
    for (std::size_t q = 0; q < points; ++q)
    {
      const std::size_t at = f * points + q;
      double excess = g * penetration(facets.shape_at(f, q), uc, z - law.height.data()[at]);
      if (law.traction)
      {
        const Traction body(law, FacetPoint(facets, x, f, q), uc, committed.at(at), false);
        trial.put(at, body.state);
        excess -= body.t;
      }
      pressure.data()[at] = std::max(excess, 0.0);
    }
  }
}

void facet_load(const Facets& facets, const Array<const double>& weights, const Array<const double>& pressure,
                const Array<double>& b)
{
  expect("weights", weights, {facets.count(), facets.points()});
  expect("pressure", pressure, {facets.count(), facets.points()});
  expect("b", b, {at_least(facets.u_nodes)});
  const std::size_t points = facets.points();
  for (std::size_t f = 0; f < facets.count(); ++f)
    for (std::size_t q = 0; q < points; ++q)
    {
      const std::size_t at = f * points + q;
      if (pressure.data()[at] > 0.0)
        for (int a = 0; a < nodes; ++a)
          b.data()[facets.dofs_of(f)[a]] += weights.data()[at] * pressure.data()[at] * facets.shape_at(f, q)[a];
    }
}

void facet_stiffness(const Facets& facets, const ContactLaw& law, const Array<const double>& u,
                     const History& committed, const Array<const double>& pressure, const BlockPattern& pattern,
                     const Array<double>& values)
{
  expect_state(facets, law, u, committed);
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
    for (std::size_t q = 0; q < points; ++q)
    {
      if (!(P[q] > 0.0))
        continue;
      const FacetPoint p(facets, x, f, q);
      const double* shape = facets.shape_at(f, q);
      Gradients slope{}, dP{};
      if (law.traction)
        slope = Traction(law, p, uc, committed.at(f * points + q), true).slope;
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
