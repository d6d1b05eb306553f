// Patterns of matrices, see patterns.hpp.
#include "patterns.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace asperity
{
namespace
{
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

Pattern::Pattern(const Array<const int>& cell_dofs, Array<const int> graph, const Array<const int>& indices, bool half)
    : indptr(graph), size(9 * indices.size()), per_cell(half ? node_pairs : nodes * nodes)
{
  expect("cell_dofs", cell_dofs, {any(), nodes});
  expect_graph("indptr", indptr, "indices", indices);
  if (!std::is_sorted(indptr.data(), indptr.data() + indptr.shape(0)))
    throw std::invalid_argument("indptr falls, expected the starts of rows one after the other");
  check_range("cell_dofs", cell_dofs, indptr.shape(0) - 1);
  offsets.reserve(cell_dofs.shape(0) * per_cell);
  for (std::size_t c = 0; c < cell_dofs.shape(0); ++c)
  {
    const int* cell = cell_dofs.data() + nodes * c;
    for (int a = 0; a < nodes; ++a)
      for (int b = half ? a : 0; b < nodes; ++b)
      {
        const bool turned = half && cell[b] < cell[a];
        offsets.push_back(position(indptr, indices, cell[turned ? b : a], cell[turned ? a : b]));
      }
  }
}
} // namespace asperity
