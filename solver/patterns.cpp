// Patterns of matrices, see patterns.hpp.
#include "patterns.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace asperity
{
namespace
{
/// Refuse inconsistent parts of a pattern.
void expect_pattern(const Array<const int>& cell_dofs, const Array<const int>& indptr, const Array<const int>& indices)
{
  expect("cell_dofs", cell_dofs, {any(), nodes});
  expect_graph("indptr", indptr, "indices", indices);
  if (!std::is_sorted(indptr.data(), indptr.data() + indptr.shape(0)))
    throw std::invalid_argument("indptr falls, expected the starts of rows one after the other");
  check_range("cell_dofs", cell_dofs, indptr.shape(0) - 1);
}

/// Place of a column in a row of a node graph.
std::uint16_t position(const Array<const int>& indptr, const Array<const int>& indices, int row, int column)
{
  const int* first = indices.data() + indptr.data()[row];
  const int* last = indices.data() + indptr.data()[row + 1];
  const int* found = std::lower_bound(first, last, column);
  if (found == last || *found != column)
    throw std::invalid_argument("indices has no column " + std::to_string(column) + " in row " + std::to_string(row)
                                + ", expected those of all nodes that share a cell");
  return static_cast<std::uint16_t>(found - first);
}
} // namespace

BlockPattern::BlockPattern(Array<const int> cell_dofs, Array<const int> indptr, Array<const int> indices)
    : Pattern{indptr, 9 * indices.size(), nodes * nodes, std::vector<std::uint16_t>(cell_dofs.size() * nodes)}
{
  expect_pattern(cell_dofs, indptr, indices);
  auto out = offsets.begin();
  for (std::size_t c = 0; c < cell_dofs.shape(0); ++c)
  {
    const int* cell = cell_dofs.data() + nodes * c;
    for (int a = 0; a < nodes; ++a)
      for (int b = 0; b < nodes; ++b)
        *out++ = position(indptr, indices, cell[a], cell[b]);
  }
}

HalfPattern::HalfPattern(Array<const int> cell_dofs, Array<const int> indptr, Array<const int> indices)
    : Pattern{indptr, 9 * indices.size(), pairs, std::vector<std::uint16_t>(cell_dofs.size() / nodes * pairs)}
{
  expect_pattern(cell_dofs, indptr, indices);
  auto out = offsets.begin();
  for (std::size_t c = 0; c < cell_dofs.shape(0); ++c)
  {
    const int* cell = cell_dofs.data() + nodes * c;
    for (int a = 0; a < nodes; ++a)
      for (int b = a; b < nodes; ++b)
        *out++ = position(indptr, indices, std::min(cell[a], cell[b]), std::max(cell[a], cell[b]));
  }
}
} // namespace asperity
