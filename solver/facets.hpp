// Contact of facets with a rigid flat whose normal is z, integrated over quadrature points.
//
// P = < g d - k t >_+ is the pressure of the flat, d = height + u_z - z its penetration, t the z component of the
// traction of the body, both per area projected on the flat: k = 0 is the penalty method, k = 1 Nitsche's method in its
// incomplete variant (Chouly, Hild & Renard, Math. Comp. 84 (2015) 1089, eq. (9) with theta = 0). The virtual work of the
// contact is int P v_z. t has the stress of the linear function through those at the points of the cell, where its history
// is.
#pragma once

#include "cells.hpp"

namespace asperity
{
/// Facets of tetrahedra and a quadrature rule on them.
struct Facets
{
  Array<const int> u_dofs;     // of the cells of the facets (facets, nodes)
  Array<const int> local;      // number of the facet in its cell (facets)
  Array<const double> shape;   // shape functions at the points of the four facets of a cell (4, points, nodes)
  Array<const double> normals; // outward, of a z component of one (facets, points, 3)
  Array<const double> weights; // projected (facets, points)
  std::size_t u_nodes;         // least number of nodes of a nodal array

  Facets(Array<const int> u_dofs, Array<const int> local, Array<const double> shape, Array<const double> normals,
         Array<const double> weights);

  std::size_t count() const { return u_dofs.shape(0); }
  std::size_t points() const { return weights.shape(1); }
  const int* dofs_of(std::size_t f) const { return u_dofs.data() + nodes * f; }
  const double* shape_at(std::size_t f, std::size_t q) const
  {
    return shape.data() + nodes * (local.data()[f] * points() + q);
  }
};

/// The contact law of a solid on its facets.
struct ContactLaw
{
  J2 material;
  bool finite; // whether strains are finite; t is then the nominal traction, per area projected before deformation
  Array<const double> stiffness; // g of each facet [force/length^3] (facets)
  Array<const double> height;    // of the undeformed surface at the points (facets, points)
  bool traction;                 // k
  Cells cells;                   // of the facets, in their order
  Array<const double> linear;    // of values at the points of a cell, those of their linear function at the points of its
                                 // facets (4, points, points of a cell)

  ContactLaw(const J2& material, bool finite, Array<const double> stiffness, Array<const double> height, bool traction,
             const Cells& cells, Array<const double> linear);

  const double* linear_at(const Facets& facets, std::size_t f, std::size_t q) const
  {
    return linear.data() + cells.points() * (facets.local.data()[f] * facets.points() + q);
  }
};

/// Pressure (facets, points) for the flat at height z and the displacement u (nodes, 3), over the history of the cells
/// `below`; one without rows means zeros.
void facet_pressure(const Facets& facets, const ContactLaw& law, double z, const Array<const double>& u,
                    const History& below, const Array<double>& pressure);

/// Add the derivative of the virtual work to the values of the matrix; `pressure` is that of the same displacement.
void facet_stiffness(const Facets& facets, const ContactLaw& law, const Array<const double>& u, const History& below,
                     const Array<const double>& pressure, const BlockPattern& pattern, const Array<double>& values);
} // namespace asperity
