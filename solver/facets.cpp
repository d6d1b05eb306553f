// Kernels of the contact of facets with a rigid flat, see facets.hpp.
#include "facets.hpp"

#include <cmath>

namespace asperity
{
namespace
{
/// What the contact law of a solid and the state of the flat are.
struct Law
{
  J2 material;
  Array1<const double> stiffness; // g of each facet [force/length^3]
  Array2<const double> height;    // of the undeformed surface at the points (facets, points)
  bool traction;                  // k
  double theta;
};

Law law(const nb::tuple& parameters, Array1<const double> stiffness, Array2<const double> height, bool traction,
        double theta)
{
  return {material(parameters), stiffness, height, traction, theta};
}

/// Response at a point; a history without facets stands for one of zeros.
Response respond(const J2& m, const Sym& strain, const History& history, std::size_t at)
{
  static constexpr double none[6] = {};
  return history.alpha.shape(0) == 0
             ? return_map(m, strain, none, 0.0)
             : return_map(m, strain, history.plastic_strain.data() + 6 * at, history.alpha.data()[at]);
}

double traction(const Sym& stress, const std::array<double, 3>& normal)
{
  return stress[4] * normal[0] + stress[5] * normal[1] + stress[2] * normal[2];
}

/// Derivative of the traction with respect to the nodal displacement.
Gradients traction_slope(const J2& m, const Response& r, const FacetPoint& p)
{
  const double lambda = m.lambda + 2.0 / 3.0 * m.mu * (1.0 - r.theta), mu = m.mu * r.theta;
  const double flow = r.chi != 0.0 ? r.chi * traction(r.direction, p.normal) : 0.0;
  Gradients out;
  for (int a = 0; a < nodes; ++a)
  {
    const auto& g = p.g[a];
    const double along = g[0] * p.normal[0] + g[1] * p.normal[1] + g[2] * p.normal[2];
    for (int j = 0; j < 3; ++j)
      out[a][j] = lambda * g[j] * p.normal[2] + mu * (g[2] * p.normal[j] + (j == 2 ? along : 0.0));
    if (flow != 0.0)
    {
      const auto ng = apply(r.direction, g);
      for (int j = 0; j < 3; ++j)
        out[a][j] += flow * ng[j];
    }
  }
  return out;
}

double penetration(const double* shape, const Gradients& u, double gap)
{
  double d = -gap;
  for (int a = 0; a < nodes; ++a)
    d += shape[a] * u[a][2];
  return d;
}

/// Projected weight of each point, out (facets, points).
void facet_weights(const Facets& facets, Array2<double> out)
{
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const Gradients x = gather(facets.x.data(), facets.x_dofs.data() + nodes * f);
    for (std::size_t q = 0; q < facets.points(); ++q)
      out.data()[f * facets.points() + q] = FacetPoint(facets, x, f, q).weight;
  }
}

/// Pressure at the points for the flat at height z, and the trial history. The part of the virtual work with
/// theta is added to `b` (nodes, 3); the force of the pressure is left to `facet_load`.
void facet_pressure(const Facets& facets, const Law& law, double z, Array2<const double> u, const History& committed,
                    const History& trial, Array2<double> pressure, Array2<double> b)
{
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
      double& P = pressure.data()[at];
      if (!law.traction)
      {
        P = std::max(excess, 0.0);
        continue;
      }
      const FacetPoint p(facets, x, f, q);
      const Response r = respond(law.material, strain(p.g, uc), committed, at);
      if (trial.alpha.shape(0) > 0)
      {
        std::copy_n(r.plastic_strain.begin(), 6, trial.plastic_strain.data() + 6 * at);
        trial.alpha.data()[at] = r.alpha;
      }
      const double t = traction(r.stress, p.normal);
      P = std::max(excess - t, 0.0);
      if (law.theta == 0.0)
        continue;
      const Gradients slope = traction_slope(law.material, r, p);
      const double scale = -law.theta / g * (P + t) * p.weight;
      for (int a = 0; a < nodes; ++a)
        for (int j = 0; j < 3; ++j)
          b.data()[3 * static_cast<std::ptrdiff_t>(facets.dofs_of(f)[a]) + j] += scale * slope[a][j];
    }
  }
}

/// Add the nodal force of a pressure at the points to b (nodes).
void facet_load(const Facets& facets, Array2<const double> weights, Array2<const double> pressure, Array1<double> b)
{
  const std::size_t points = facets.points();
  for (std::size_t f = 0; f < facets.count(); ++f)
    for (std::size_t q = 0; q < points; ++q)
    {
      const std::size_t at = f * points + q;
      if (pressure.data()[at] > 0.0)
        for (int a = 0; a < nodes; ++a)
          b.data()[facets.dofs_of(f)[a]]
              += weights.data()[at] * pressure.data()[at] * facets.shape_at(f, q)[a];
    }
}

/// Add the derivative of the virtual work; `pressure` is that of the same displacement.
void facet_stiffness(const Facets& facets, const Law& law, Array2<const double> u, const History& committed,
                     Array2<const double> pressure, const BlockPattern& pattern, Array1<double> values)
{
  double* out = pattern.start(values);
  const std::size_t points = facets.points();
  double A[dofs * dofs];
  for (std::size_t f = 0; f < facets.count(); ++f)
  {
    const double* P = pressure.data() + f * points;
    if (law.theta == 0.0 && std::none_of(P, P + points, [](double p) { return p > 0.0; }))
      continue;
    std::fill_n(A, dofs * dofs, 0.0);
    const Gradients x = gather(facets.x.data(), facets.x_dofs.data() + nodes * f);
    const Gradients uc = gather(u.data(), facets.dofs_of(f));
    const double g = law.stiffness.data()[f];
    for (std::size_t q = 0; q < points; ++q)
    {
      const bool pressed = P[q] > 0.0;
      if (!pressed && law.theta == 0.0)
        continue;
      const FacetPoint p(facets, x, f, q);
      const double* shape = facets.shape_at(f, q);
      Gradients slope{}, dP{};
      if (law.traction)
        slope = traction_slope(law.material,
                               respond(law.material, strain(p.g, uc), committed, f * points + q), p);
      if (pressed)
        for (int a = 0; a < nodes; ++a)
        {
          for (int j = 0; j < 3; ++j)
            dP[a][j] = -slope[a][j];
          dP[a][2] += g * shape[a];
        }
      for (int a = 0; a < nodes; ++a)
        for (int i = 0; i < 3; ++i)
        {
          const double pressing = i == 2 ? p.weight * shape[a] : 0.0;
          const double symmetrising = law.theta == 0.0 ? 0.0 : -p.weight * law.theta / g * slope[a][i];
          if (pressing == 0.0 && symmetrising == 0.0)
            continue;
          double* row = A + (3 * a + i) * dofs;
          for (int b = 0; b < nodes; ++b)
            for (int j = 0; j < 3; ++j)
              row[3 * b + j] += pressing * dP[b][j] + symmetrising * (dP[b][j] + slope[b][j]);
        }
    }
    pattern.add_full(facets.dofs_of(f), f, A, out);
  }
}
} // namespace

void bind_facets(nb::module_& m)
{
  nb::class_<Facets>(m, "Facets")
      .def("__init__",
           [](Facets* self, Array2<const double> x, Array2<const int> x_dofs, Array2<const int> u_dofs,
              Array1<const int> local,
              nb::ndarray<const double, nb::ndim<4>, nb::c_contig, nb::device::cpu> gradients,
              Array3<const double> shape, Array2<const double> normals, Array1<const double> weights)
           {
             if (x.shape(1) != 3 || x_dofs.shape(1) != nodes || u_dofs.shape(1) != nodes
                 || x_dofs.shape(0) != u_dofs.shape(0) || local.shape(0) != u_dofs.shape(0)
                 || gradients.shape(0) != 4 || gradients.shape(1) != weights.shape(0)
                 || gradients.shape(2) != nodes || gradients.shape(3) != 3 || shape.shape(0) != 4
                 || shape.shape(1) != weights.shape(0) || shape.shape(2) != nodes
                 || normals.shape(0) != 4 || normals.shape(1) != 3)
               throw std::invalid_argument("Facets: array shapes do not belong to second-order tetrahedra");
             new (self) Facets{x, x_dofs, u_dofs, local, gradients, shape, normals, weights};
           },
           nb::arg("x"), nb::arg("x_dofs"), nb::arg("u_dofs"), nb::arg("local"), nb::arg("gradients"),
           nb::arg("shape"), nb::arg("normals"), nb::arg("weights"));
  nb::class_<Law>(m, "ContactLaw")
      .def("__init__",
           [](Law* self, const nb::tuple& parameters, Array1<const double> stiffness, Array2<const double> height,
              bool traction, double theta)
           { new (self) Law(law(parameters, stiffness, height, traction, theta)); },
           nb::arg("material"), nb::arg("stiffness"), nb::arg("height"), nb::arg("traction"), nb::arg("theta"));
  m.def("facet_weights", &facet_weights, nb::arg("facets"), nb::arg("out"));
  m.def("facet_pressure", &facet_pressure, nb::arg("facets"), nb::arg("law"), nb::arg("z"), nb::arg("u"),
        nb::arg("committed"), nb::arg("trial"), nb::arg("pressure"), nb::arg("b"));
  m.def("facet_load", &facet_load, nb::arg("facets"), nb::arg("weights"), nb::arg("pressure"), nb::arg("b"));
  m.def("facet_stiffness", &facet_stiffness, nb::arg("facets"), nb::arg("law"), nb::arg("u"), nb::arg("committed"),
        nb::arg("pressure"), nb::arg("pattern"), nb::arg("values"));
}
} // namespace asperity
