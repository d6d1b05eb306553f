// Python interface of the element kernels; kernels of the cells.
#include "cells.hpp"
#include "facets.hpp"
#include "linear.hpp"

using namespace asperity;

namespace
{
/// Volume of each quadrature point, out (cells, points).
void volumes(const Cells& cells, Array2<double> out)
{
  Gradients g;
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    const Gradients x = cells.coordinates(c);
    for (std::size_t q = 0; q < cells.points(); ++q)
      out.data()[c * cells.points() + q]
          = push_forward(cells.gradients.data() + 30 * q, x, g) * cells.weights.data()[q];
  }
}

/// Smallest Jacobian determinant over the quadrature points of each cell.
void min_jacobian(const Cells& cells, Array1<double> out)
{
  Gradients g;
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    const Gradients x = cells.coordinates(c);
    double smallest = 1e300;
    for (std::size_t q = 0; q < cells.points(); ++q)
      smallest = std::min(smallest, push_forward(cells.gradients.data() + 30 * q, x, g));
    out.data()[c] = smallest;
  }
}

/// Add the internal force of `u` to `b`; one pass gives stress, trial history and a plastic flag per cell.
/// Returns the number of points that flow.
std::int64_t residual_j2(const Cells& cells, const nb::tuple& parameters, Array2<const double> u,
                 const History& committed, const History& trial, Array1<bool> plastic,
                 Array2<double> b)
{
  const J2 m = material(parameters);
  const std::size_t points = cells.points();
  std::int64_t flowing = 0;
  Gradients g;
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    const Gradients x = cells.coordinates(c), uc = gather(u.data(), cells.dofs_of(c));
    Gradients f{};
    int any = 0;
    for (std::size_t q = 0; q < points; ++q)
    {
      const double det = push_forward(cells.gradients.data() + 30 * q, x, g);
      const std::size_t at = c * points + q;
      const Response r = return_map(m, strain(g, uc), committed.plastic_strain.data() + 6 * at,
                                    committed.alpha.data()[at]);
      std::copy_n(r.plastic_strain.begin(), 6, trial.plastic_strain.data() + 6 * at);
      trial.alpha.data()[at] = r.alpha;
      any += r.plastic;
      add_residual(g, r.stress, det * cells.weights.data()[q], f);
    }
    plastic.data()[c] = any > 0;
    flowing += any;
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        b.data()[3 * static_cast<std::ptrdiff_t>(cells.dofs_of(c)[a]) + i] += f[a][i];
  }
  return flowing;
}

/// The same for a linear elastic material, which has no history.
void residual_elastic(const Cells& cells, double lambda, double mu, Array2<const double> u,
                      Array2<double> b)
{
  Gradients g;
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    const Gradients x = cells.coordinates(c), uc = gather(u.data(), cells.dofs_of(c));
    Gradients f{};
    for (std::size_t q = 0; q < cells.points(); ++q)
    {
      const double det = push_forward(cells.gradients.data() + 30 * q, x, g);
      Sym s = strain(g, uc);
      const double trace = s[0] + s[1] + s[2];
      for (int i = 0; i < 6; ++i)
        s[i] = 2.0 * mu * s[i] + (i < 3 ? lambda * trace : 0.0);
      add_residual(g, s, det * cells.weights.data()[q], f);
    }
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        b.data()[3 * static_cast<std::ptrdiff_t>(cells.dofs_of(c)[a]) + i] += f[a][i];
  }
}

/// Add the elastic stiffness of all cells.
void stiffness_elastic(const Cells& cells, double lambda, double mu, const BlockPattern& pattern, Array1<double> values)
{
  double* out = pattern.start(values);
  Gradients g;
  double A[dofs * dofs];
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    std::fill_n(A, dofs * dofs, 0.0);
    const Gradients x = cells.coordinates(c);
    for (std::size_t q = 0; q < cells.points(); ++q)
    {
      const double det = push_forward(cells.gradients.data() + 30 * q, x, g);
      add_stiffness(g, lambda, mu, 0.0, {}, det * cells.weights.data()[q], A);
    }
    pattern.add(cells.dofs_of(c), c, A, out);
  }
}

/// Add consistent tangent minus elastic stiffness of the cells marked plastic.
void stiffness_plastic(const Cells& cells, const nb::tuple& parameters, Array2<const double> u,
                       const History& committed, Array1<const bool> plastic, const BlockPattern& pattern,
                       Array1<double> values)
{
  double* out = pattern.start(values);
  const J2 m = material(parameters);
  const std::size_t points = cells.points();
  Gradients g;
  double A[dofs * dofs];
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    if (!plastic.data()[c])
      continue;
    std::fill_n(A, dofs * dofs, 0.0);
    const Gradients x = cells.coordinates(c), uc = gather(u.data(), cells.dofs_of(c));
    for (std::size_t q = 0; q < points; ++q)
    {
      const double det = push_forward(cells.gradients.data() + 30 * q, x, g);
      const std::size_t at = c * points + q;
      const Response r = return_map(m, strain(g, uc), committed.plastic_strain.data() + 6 * at,
                                    committed.alpha.data()[at]);
      if (r.plastic)
        add_stiffness(g, -2.0 / 3.0 * m.mu * (r.theta - 1.0), m.mu * (r.theta - 1.0), r.chi,
                      r.direction, det * cells.weights.data()[q], A);
    }
    pattern.add(cells.dofs_of(c), c, A, out);
  }
}

/// Stress at the quadrature points, out (cells, points, 6).
void stress(const Cells& cells, const nb::tuple& parameters, Array2<const double> u,
            const History& committed, Array3<double> out)
{
  const J2 m = material(parameters);
  Gradients g;
  for (std::size_t c = 0; c < cells.count(); ++c)
  {
    const Gradients x = cells.coordinates(c), uc = gather(u.data(), cells.dofs_of(c));
    for (std::size_t q = 0; q < cells.points(); ++q)
    {
      push_forward(cells.gradients.data() + 30 * q, x, g);
      const std::size_t at = c * cells.points() + q;
      const Response r = return_map(m, strain(g, uc), committed.plastic_strain.data() + 6 * at,
                                    committed.alpha.data()[at]);
      std::copy_n(r.stress.begin(), 6, out.data() + 6 * at);
    }
  }
}
} // namespace

NB_MODULE(_solver, m)
{
  m.doc() = "Element kernels for curved second-order tetrahedra: elasticity and J2 plasticity.";
  nb::class_<Cells>(m, "Cells")
      .def(nb::init<Array2<const double>, Array2<const int>, Array2<const int>, Array3<const double>,
                    Array1<const double>>(),
           nb::arg("x"), nb::arg("x_dofs"), nb::arg("u_dofs"), nb::arg("gradients"),
           nb::arg("weights"));
  nb::class_<History>(m, "History")
      .def(nb::init<Array3<double>, Array2<double>>(), nb::arg("plastic_strain"), nb::arg("alpha"));
  m.def("volumes", &volumes, nb::arg("cells"), nb::arg("out"));
  m.def("min_jacobian", &min_jacobian, nb::arg("cells"), nb::arg("out"));
  m.def("residual_elastic", &residual_elastic, nb::arg("cells"), nb::arg("lam"), nb::arg("mu"),
        nb::arg("u"), nb::arg("b"));
  m.def("residual_j2", &residual_j2, nb::arg("cells"), nb::arg("material"), nb::arg("u"),
        nb::arg("committed"), nb::arg("trial"), nb::arg("plastic"), nb::arg("b"));
  nb::class_<BlockPattern>(m, "BlockPattern")
      .def(nb::init<Array2<const int>, Array1<const int>, Array1<const int>>(), nb::arg("cell_dofs"),
           nb::arg("indptr"), nb::arg("indices"));
  m.def("stiffness_elastic", &stiffness_elastic, nb::arg("cells"), nb::arg("lam"), nb::arg("mu"),
        nb::arg("pattern"), nb::arg("values"));
  m.def("stiffness_plastic", &stiffness_plastic, nb::arg("cells"), nb::arg("material"), nb::arg("u"),
        nb::arg("committed"), nb::arg("plastic"), nb::arg("pattern"), nb::arg("values"));
  m.def("stress", &stress, nb::arg("cells"), nb::arg("material"), nb::arg("u"), nb::arg("committed"),
        nb::arg("out"));
  bind_facets(m);
  bind_linear(m);
}
