// What the compiled kernels share: arrays from Python, cells, history, the local matrix. All arrays are local to the
// process.
#pragma once

#include "tet10.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <stdexcept>
#include <vector>

namespace asperity
{
namespace nb = nanobind;

template <typename T>
using Array1 = nb::ndarray<T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Array2 = nb::ndarray<T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Array3 = nb::ndarray<T, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

/// Second-order tetrahedra with one quadrature rule: geometry, dofs, tabulated basis.
struct Cells
{
  Array2<const double> x;         // node coordinates (n, 3)
  Array2<const int> x_dofs;       // (cells, 10)
  Array2<const int> u_dofs;       // (cells, 10)
  Array3<const double> gradients; // reference gradients at the points (points, 10, 3)
  Array1<const double> weights;   // quadrature weights on the reference cell (points)

  Cells(Array2<const double> x, Array2<const int> x_dofs, Array2<const int> u_dofs,
        Array3<const double> gradients, Array1<const double> weights)
      : x(x), x_dofs(x_dofs), u_dofs(u_dofs), gradients(gradients), weights(weights)
  {
    if (x.shape(1) != 3 || x_dofs.shape(1) != nodes || u_dofs.shape(1) != nodes
        || gradients.shape(1) != nodes || gradients.shape(2) != 3
        || gradients.shape(0) != weights.shape(0) || x_dofs.shape(0) != u_dofs.shape(0))
      throw std::invalid_argument("Cells: array shapes do not belong to second-order tetrahedra");
  }
  std::size_t count() const { return x_dofs.shape(0); }
  std::size_t points() const { return weights.shape(0); }
  Gradients coordinates(std::size_t c) const { return gather(x.data(), x_dofs.data() + nodes * c); }
  const int* dofs_of(std::size_t c) const { return u_dofs.data() + nodes * c; }
};

/// Committed or trial history: plastic strain (cells, points, 6) and its accumulated norm (cells, points).
struct History
{
  Array3<double> plastic_strain;
  Array2<double> alpha;
};

inline J2 material(const nb::tuple& parameters)
{
  return {nb::cast<double>(parameters[0]), nb::cast<double>(parameters[1]),
          nb::cast<double>(parameters[2]), nb::cast<double>(parameters[3])};
}

/// Where element matrices go among the values of a scalar CSR matrix with 3 x 3 node blocks, all three rows of a node
/// having the same columns. The node graph (indptr, indices) is that of the local cells; `offsets` (cells, 10, 10)
/// holds where in row a column b stands.
struct BlockPattern
{
  Array1<const int> indptr;
  std::size_t size; // of the values
  std::vector<std::uint16_t> offsets;

  /// `cell_dofs` (cells, 10): nodes of the cells whose element matrices will be added.
  BlockPattern(Array2<const int> cell_dofs, Array1<const int> indptr, Array1<const int> indices)
      : indptr(indptr), size(9 * indices.size()), offsets(cell_dofs.size() * nodes)
  {
    auto out = offsets.begin();
    for (std::size_t c = 0; c < cell_dofs.shape(0); ++c)
    {
      const int* cell = cell_dofs.data() + nodes * c;
      for (int a = 0; a < nodes; ++a)
      {
        const int* first = indices.data() + indptr.data()[cell[a]];
        const int* last = indices.data() + indptr.data()[cell[a] + 1];
        for (int b = 0; b < nodes; ++b)
          *out++ = static_cast<std::uint16_t>(std::lower_bound(first, last, cell[b]) - first);
      }
    }
  }

  /// The start of an array of values, which has to have their number.
  double* start(const Array1<double>& values) const
  {
    if (values.size() != size)
      throw std::invalid_argument("BlockPattern: the number of values is not that of the graph");
    return values.data();
  }

  /// Add a symmetric 30 x 30 element matrix, of which the node pairs a <= b are given.
  void add(const int* cell_dofs, std::size_t c, const double* A, double* values) const
  {
    add<true>(cell_dofs, c, A, values);
  }

  /// Add a full 30 x 30 element matrix.
  void add_full(const int* cell_dofs, std::size_t c, const double* A, double* values) const
  {
    add<false>(cell_dofs, c, A, values);
  }

private:
  template <bool symmetric>
  void add(const int* cell_dofs, std::size_t c, const double* A, double* values) const
  {
    const std::uint16_t* offset = offsets.data() + c * nodes * nodes;
    for (int a = 0; a < nodes; ++a)
    {
      const std::ptrdiff_t begin = indptr.data()[cell_dofs[a]];
      const std::ptrdiff_t width = 3 * (indptr.data()[cell_dofs[a] + 1] - begin);
      for (int b = 0; b < nodes; ++b)
      {
        double* target = values + 9 * begin + 3 * offset[nodes * a + b];
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            target[i * width + j]
                += !symmetric || a <= b ? A[(3 * a + i) * dofs + 3 * b + j]
                                        : A[(3 * b + j) * dofs + 3 * a + i];
      }
    }
  }
};
} // namespace asperity
