// Kernels of the linear solver: products, and the coarse matrix of its multigrid. A product takes as long as reading
// the matrix, so of a symmetric one only the upper half is read, in single precision where few digits suffice. All
// matrices have three dofs per node, on a square CSR graph of the nodes (indptr, indices); `values` holds the three
// rows of a node one after the other, like PETSc's AIJ. The kernels check the ends of a graph, not its entries.
#pragma once

#include "arrays.hpp"

#include <variant>

namespace asperity
{
using Graph = Array<const int>;

/// y = A x, both (nodes, 3).
void product(const Graph& indptr, const Graph& indices, const Array<const double>& values, const Array<const double>& x,
             const Array<double>& y);

/// Blocks of the upper half row by row, the diagonal ones first in theirs, the columns of each one after the other.
void upper_half(const Graph& indptr, const Graph& indices, const Array<const double>& values, const Array<float>& out);

/// y = A x for the symmetric A whose upper half is given by the columns of its blocks (blocks, 9) and one float behind;
/// the graph is that of the upper half. x and y have three components and one to spare (nodes, 4), zero in y.
void symmetric_product(const Graph& indptr, const Graph& indices, const Array<const float>& blocks,
                       const Array<const float>& x, const Array<float>& y);

/// Subtract the image of the last step from the residual at the free dofs, then step by keep * step + add * scaling *
/// residual; all arrays have the same length.
void relax(const Array<const float>& image, const Array<const float>& free, const Array<const float>& scaling,
           float keep, float add, const Array<float>& residual, const Array<float>& step, const Array<float>& x);

/// All values of a matrix, or the blocks of its upper half as in `symmetric_product`.
using Matrix = std::variant<Array<const double>, Array<const float>>;

/// Galerkin's coarse matrix (m P c)^T A (m P c): `kept` (nodes, 3) is the mask m, `coarse_kept` the mask c, and P gives
/// each node the mean of its two `parents` (nodes, 2), which are the same for a node of the coarse level.
void galerkin(const Graph& indptr, const Graph& indices, const Matrix& values, const Array<const double>& kept,
              const Array<const int>& parents, const Graph& coarse_indptr, const Graph& coarse_indices,
              const Array<const double>& coarse_kept, const Array<double>& coarse);
} // namespace asperity
