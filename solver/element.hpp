// The element of all meshes, the curved second-order tetrahedron: strain, residual and stiffness of a quadrature point.
#pragma once

#include "law.hpp"

#include <algorithm>
#include <cstddef>

namespace asperity
{
constexpr int nodes = 10; // of a cell, the only number that another Lagrange element on tetrahedra changes here
constexpr int dofs = 3 * nodes;
constexpr int row_length = (dofs + 7) / 8 * 8; // of element matrices: a multiple of the width of vectors

using Gradients = std::array<std::array<double, 3>, nodes>;

/// Physical gradients of the shape functions from their reference gradients and node coordinates; returns det J.
inline double push_forward(const double* reference, const Gradients& x, Gradients& g)
{
  double J[3][3] = {}, K[3][3]; // cofactors: J^-1 = K / det with K[i][j] = d xi_i/d x_j * det
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        J[i][j] += x[a][i] * reference[3 * a + j];
  K[0][0] = J[1][1] * J[2][2] - J[1][2] * J[2][1];
  K[0][1] = J[0][2] * J[2][1] - J[0][1] * J[2][2];
  K[0][2] = J[0][1] * J[1][2] - J[0][2] * J[1][1];
  K[1][0] = J[1][2] * J[2][0] - J[1][0] * J[2][2];
  K[1][1] = J[0][0] * J[2][2] - J[0][2] * J[2][0];
  K[1][2] = J[0][2] * J[1][0] - J[0][0] * J[1][2];
  K[2][0] = J[1][0] * J[2][1] - J[1][1] * J[2][0];
  K[2][1] = J[0][1] * J[2][0] - J[0][0] * J[2][1];
  K[2][2] = J[0][0] * J[1][1] - J[0][1] * J[1][0];
  const double det = J[0][0] * K[0][0] + J[0][1] * K[1][0] + J[0][2] * K[2][0], inv = 1.0 / det;
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      g[a][i] = inv * (reference[3 * a] * K[0][i] + reference[3 * a + 1] * K[1][i] + reference[3 * a + 2] * K[2][i]);
  return det;
}

/// Small strain of the nodal displacement `u`.
inline Sym strain(const Gradients& g, const Gradients& u)
{
  Sym e{};
  for (int a = 0; a < nodes; ++a)
  {
    e[0] += g[a][0] * u[a][0];
    e[1] += g[a][1] * u[a][1];
    e[2] += g[a][2] * u[a][2];
    e[3] += 0.5 * (g[a][1] * u[a][0] + g[a][0] * u[a][1]);
    e[4] += 0.5 * (g[a][2] * u[a][0] + g[a][0] * u[a][2]);
    e[5] += 0.5 * (g[a][2] * u[a][1] + g[a][1] * u[a][2]);
  }
  return e;
}

/// Product of a symmetric tensor with a vector.
inline std::array<double, 3> times(const Sym& s, const std::array<double, 3>& v)
{
  return {s[0] * v[0] + s[3] * v[1] + s[4] * v[2], s[3] * v[0] + s[1] * v[1] + s[5] * v[2],
          s[4] * v[0] + s[5] * v[1] + s[2] * v[2]};
}

/// Add weight * B^T sigma to the element residual.
inline void add_residual(const Gradients& g, const Sym& stress, double weight, Gradients& b)
{
  for (int a = 0; a < nodes; ++a)
  {
    const auto f = times(stress, g[a]);
    for (int i = 0; i < 3; ++i)
      b[a][i] += weight * f[i];
  }
}

/// Row and column of the component i of node a in an element matrix; the nodes of a component are side by side.
constexpr int dof(int a, int i)
{
  return nodes * i + a;
}

/// Derivative of the nominal stress P with respect to the displacement gradient: C[3 i + J][3 k + L] = dP_iJ/dF_kL.
using Tangent = std::array<std::array<double, 9>, 9>;

/// The derivative in small strain, lambda 1x1 + 2 mu I + chi n x n.
inline Tangent nominal_tangent(const Moduli& C, const Sym& n)
{
  const auto [lambda, mu, chi] = C;
  const double N[9] = {n[0], n[3], n[4], n[3], n[1], n[5], n[4], n[5], n[2]};
  Tangent out;
  for (int r = 0; r < 9; ++r)
    for (int s = 0; s < 9; ++s)
      out[r][s] = chi * N[r] * N[s];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      out[4 * i][4 * j] += lambda;
      out[3 * i + j][3 * i + j] += mu;
      out[3 * i + j][3 * j + i] += mu;
    }
  return out;
}

/// Add weight * g_a C g_b to the dofs x row_length element matrix of the row-major order `dof`, from the diagonal on.
inline void add_stiffness(const Gradients& g, const Tangent& C, double weight, double* A)
{
  double G[3][nodes], V[9][row_length] = {}; // gradients by component, C g_b
  for (int b = 0; b < nodes; ++b)
    for (int j = 0; j < 3; ++j)
      G[j][b] = g[b][j];
  for (int r = 0; r < 9; ++r)
    for (int k = 0; k < 3; ++k)
    {
      const double x = weight * C[r][3 * k], y = weight * C[r][3 * k + 1], z = weight * C[r][3 * k + 2];
      for (int b = 0; b < nodes; ++b)
        V[r][dof(b, k)] = x * G[0][b] + y * G[1][b] + z * G[2][b];
    }
  constexpr int width = 8; // columns in one go, from the last multiple on
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < nodes; ++a)
      for (int first = dof(a, i) / width * width; first < row_length; first += width)
      {
        double* row = A + dof(a, i) * row_length + first;
        for (int c = 0; c < width; ++c)
          row[c] += G[0][a] * V[3 * i][first + c] + G[1][a] * V[3 * i + 1][first + c]
                    + G[2][a] * V[3 * i + 2][first + c];
      }
}

/// Add the rows of a cell to the rows `cell_dofs` of a nodal (n, 3) array.
inline void scatter(const Gradients& f, const int* cell_dofs, double* values)
{
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      values[3 * static_cast<std::ptrdiff_t>(cell_dofs[a]) + i] += f[a][i];
}

/// Gather the rows `cell_dofs` of a nodal (n, 3) array.
inline Gradients gather(const double* values, const int* cell_dofs)
{
  Gradients v;
  for (int a = 0; a < nodes; ++a)
    std::copy_n(values + 3 * static_cast<std::ptrdiff_t>(cell_dofs[a]), 3, v[a].begin());
  return v;
}
} // namespace asperity
