// Where the element matrices of cells and facets go in a matrix: the whole, or the upper half of a symmetric one.
#pragma once

#include "arrays.hpp"
#include "element.hpp"

#include <cstdint>
#include <vector>

namespace asperity
{
constexpr int node_pairs = nodes * (nodes + 1) / 2; // of the nodes of a cell, each with itself included

/// Row starts of the node graph of a matrix, its number of values, and positions of element matrices in it.
struct Pattern
{
  Array<const int> indptr;
  std::size_t size, per_cell;
  std::vector<std::uint16_t> offsets; // (cells, per_cell)

  /// `cell_dofs` (cells, nodes): nodes of the cells whose element matrices will be added; whole, or the upper `half`.
  Pattern(const Array<const int>& cell_dofs, Array<const int> graph, const Array<const int>& indices, bool half);

  /// Start of an array of values, refused if shorter than `size`; `cells` is the number of matrices to add.
  template <typename Value>
  Value* start(const Array<Value>& values, std::size_t cells) const
  {
    if (offsets.size() != per_cell * cells)
      throw std::invalid_argument("pattern has " + std::to_string(offsets.size() / per_cell) + " cells, expected "
                                  + std::to_string(cells));
    expect("values", values, {at_least(size)});
    return values.data();
  }
};

/// Positions of element matrices in the values of a scalar CSR matrix with 3 x 3 node blocks, where the three rows of a
/// node have the same columns. The node graph (indptr, indices) is that of the local cells; `offsets` (cells, nodes,
/// nodes) holds the position of column b in row a.
struct BlockPattern : Pattern
{
  using Value = double;

  BlockPattern(Array<const int> cell_dofs, Array<const int> indptr, Array<const int> indices)
      : Pattern(cell_dofs, indptr, indices, false)
  {
  }

  /// Start to load what `add` changes, which is in no cache, while the element matrix is computed.
  void prefetch(const int* cell_dofs, std::size_t c, double* values) const
  {
    const std::uint16_t* offset = offsets.data() + c * nodes * nodes;
    for (int a = 0; a < nodes; ++a, offset += nodes)
    {
      const std::ptrdiff_t begin = indptr.data()[cell_dofs[a]];
      const std::ptrdiff_t width = 3 * (indptr.data()[cell_dofs[a] + 1] - begin);
      for (int i = 0; i < 3; ++i)
        for (int b = 0; b < nodes; ++b)
          __builtin_prefetch(values + 9 * begin + i * width + 3 * offset[b], 1);
    }
  }

  /// Add the element matrix of a cell, in the order `dof`.
  void add(const int* cell_dofs, std::size_t c, const double* A, double* values) const
  {
    const std::uint16_t* offset = offsets.data() + c * nodes * nodes;
    for (int a = 0; a < nodes; ++a, offset += nodes)
    {
      const std::ptrdiff_t begin = indptr.data()[cell_dofs[a]];
      const std::ptrdiff_t width = 3 * (indptr.data()[cell_dofs[a] + 1] - begin);
      for (int i = 0; i < 3; ++i)
      {
        double* target = values + 9 * begin + i * width;
        const double* row = A + dof(a, i) * row_length;
        for (int b = 0; b < nodes; ++b)
          for (int j = 0; j < 3; ++j)
            target[3 * offset[b] + j] += row[dof(b, j)];
      }
    }
  }
};

/// Positions of symmetric element matrices in the upper half of a matrix, in single precision: the columns of its blocks
/// (blocks, 9), see linear.hpp. The graph is that of the upper half; `offsets` (cells, node_pairs) holds the position
/// of the later node of a pair in the row of the earlier one.
struct HalfPattern : Pattern
{
  using Value = float;

  HalfPattern(Array<const int> cell_dofs, Array<const int> indptr, Array<const int> indices)
      : Pattern(cell_dofs, indptr, indices, true)
  {
  }

  /// Call `at(a, b, block)` for each pair of nodes of a cell, the one that comes first in the matrix first.
  template <typename At>
  void at_pairs(const int* cell_dofs, std::size_t c, float* blocks, At at) const
  {
    const std::uint16_t* offset = offsets.data() + c * node_pairs;
    for (int a = 0; a < nodes; ++a)
      for (int b = a; b < nodes; ++b, ++offset)
      {
        const bool sorted = cell_dofs[a] <= cell_dofs[b];
        const int first = sorted ? a : b, second = sorted ? b : a;
        at(first, second, blocks + 9 * (static_cast<std::ptrdiff_t>(indptr.data()[cell_dofs[first]]) + *offset));
      }
  }

  void prefetch(const int* cell_dofs, std::size_t c, float* blocks) const
  {
    at_pairs(cell_dofs, c, blocks, [](int, int, float* block) { __builtin_prefetch(block, 1); });
  }

  void add(const int* cell_dofs, std::size_t c, const double* A, float* blocks) const
  {
    at_pairs(cell_dofs, c, blocks,
             [&](int a, int b, float* block)
             {
               for (int j = 0; j < 3; ++j)
                 for (int i = 0; i < 3; ++i)
                   block[3 * j + i] += static_cast<float>(A[dof(a, i) * row_length + dof(b, j)]);
             });
  }
};
} // namespace asperity
