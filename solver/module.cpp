// Python interface: the classes and kernels of the module asperity._solver. Kernels run without the interpreter's lock.
#include "cells.hpp"
#ifdef ASPERITY_CHOLMOD
#include "cholesky.hpp"
#endif
#include "facets.hpp"
#include "linear.hpp"
#include "size_field.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/variant.h>

using namespace asperity;
using namespace nb::literals;

namespace
{
const auto unlocked = nb::call_guard<nb::gil_scoped_release>();

/// Array that a kernel writes, never a converted copy. The type is nb::arg in nanobind 2, another one in nanobind 3.
auto out(const char* name)
{
  return nb::arg(name).noconvert();
}

void bind_law(nb::module_& m)
{
  nb::class_<J2>(m, "J2",
                 "J2 plasticity with linear hardening: Lame moduli, initial yield stress, plastic modulus "
                 "[force/length^2], share of the hardening that is kinematic.")
      .def(nb::init<double, double, double, double, double, bool>(), "lam"_a, "mu"_a, "yield_stress"_a, "hardening"_a,
           "kinematic_share"_a, "secant"_a = false);
}

template <typename Pattern>
void bind_stiffness(nb::module_& m)
{
  m.def("stiffness_elastic", &stiffness_elastic<Pattern>, "cells"_a, "law"_a, "pattern"_a, out("values"), unlocked);
  m.def("stiffness_consistent", &stiffness_consistent<Pattern>, "cells"_a, "law"_a, "finite"_a, "u"_a, "committed"_a,
        "marked"_a, "pattern"_a, out("values"), unlocked);
}

void bind_cells(nb::module_& m)
{
  nb::class_<Cells>(m, "Cells")
      .def(
          nb::init<Array<const double>, Array<const int>, Array<const int>, Array<const double>, Array<const double>,
                   double, double>(),
          "x"_a, "x_dofs"_a, "u_dofs"_a, "gradients"_a, "weights"_a, "spent"_a, "threshold"_a);
  nb::class_<History>(m, "History")
      .def(nb::init<Array<double>, Array<double>, Array<double>>(), out("plastic_strain"), out("accumulated"),
           out("dilatation"));
  nb::class_<BlockPattern>(m, "BlockPattern")
      .def(nb::init<Array<const int>, Array<const int>, Array<const int>>(), "cell_dofs"_a, "indptr"_a, "indices"_a);
  nb::class_<HalfPattern>(m, "HalfPattern")
      .def(nb::init<Array<const int>, Array<const int>, Array<const int>>(), "cell_dofs"_a, "indptr"_a, "indices"_a);
  m.def("residual", &residual, "cells"_a, "law"_a, "finite"_a, "u"_a, "committed"_a, "trial"_a, out("plastic"), out("b"),
        unlocked);
  bind_stiffness<BlockPattern>(m);
  bind_stiffness<HalfPattern>(m);
  m.def("stress", &stress, "cells"_a, "law"_a, "finite"_a, "conjugate"_a, "u"_a, "committed"_a, out("out"), unlocked);
}

void bind_facets(nb::module_& m)
{
  nb::class_<Facets>(m, "Facets")
      .def(nb::init<Array<const int>, Array<const int>, Array<const double>, Array<const double>,
                    Array<const double>>(),
           "u_dofs"_a, "local"_a, "shape"_a, "normals"_a, "weights"_a);
  nb::class_<ContactLaw>(m, "ContactLaw")
      .def(nb::init<const J2&, bool, Array<const double>, Array<const double>, bool, const Cells&,
                    Array<const double>>(),
           "material"_a, "finite"_a, "stiffness"_a, "height"_a, "traction"_a, "cells"_a, "linear"_a);
  m.def("facet_pressure", &facet_pressure, "facets"_a, "law"_a, "z"_a, "u"_a, "below"_a, out("pressure"),
        unlocked);
  m.def("facet_stiffness", &facet_stiffness, "facets"_a, "law"_a, "u"_a, "below"_a, "pressure"_a, "pattern"_a,
        out("values"), unlocked);
}

void bind_linear(nb::module_& m)
{
  m.def("product", &product, "indptr"_a, "indices"_a, "values"_a, "x"_a, out("y"), unlocked);
  m.def("upper_half", &upper_half, "indptr"_a, "indices"_a, "values"_a, out("out"), unlocked);
  m.def("symmetric_product", &symmetric_product, "indptr"_a, "indices"_a, "blocks"_a, "x"_a, out("y"), unlocked);
  m.def("relax", &relax, "image"_a, "free"_a, "scaling"_a, "keep"_a, "add"_a, out("residual"), out("step"), out("x"),
        unlocked);
  m.def("galerkin", &galerkin, "indptr"_a, "indices"_a, "values"_a, "kept"_a, "parents"_a, "coarse_indptr"_a,
        "coarse_indices"_a, "coarse_kept"_a, out("coarse"), unlocked);
#ifdef ASPERITY_CHOLMOD
  if (!Cholesky::available())
    return;
  nb::class_<Cholesky>(m, "Cholesky")
      .def(nb::init<Graph, Graph, Array<const int>>(), "starts"_a, "rows"_a, "order"_a)
      .def_static("best_order", &Cholesky::best_order, "starts"_a, "rows"_a, out("order"), unlocked)
      .def("factorise", &Cholesky::factorise, "values"_a, unlocked)
      .def("last_block", &Cholesky::last_block, out("out"), unlocked)
      .def("solve", &Cholesky::solve, out("x"), "transposed"_a, unlocked);
#endif
}

void bind_size_field(nb::module_& m)
{
  nb::class_<SizeField>(m, "SizeField")
      .def(nb::init<Array<const double>, Array<const double>, std::array<double, 3>, double, double, double, bool>(),
           "sizes"_a, "distances"_a, "window"_a, "growth"_a, "layer"_a, "h_max"_a, "periodic"_a)
      .def("at", &SizeField::at, "x"_a, "y"_a, "depth"_a);
}
} // namespace

NB_MODULE(_solver, m)
{
  nb::set_leak_warnings(false); // results of a script live until the interpreter ends
  m.doc() = "Kernels for curved second-order tetrahedra: element sizes, elasticity, J2 plasticity, contact, linear solver.";
  bind_law(m);
  bind_cells(m);
  bind_facets(m);
  bind_linear(m);
  bind_size_field(m);
}
