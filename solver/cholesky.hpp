// Cholesky factors of a coarse matrix in single precision, by CHOLMOD (Chen et al., ACM Trans. Math. Softw. 35 (2008)
// 22), whole or by substructures (Przemieniecki, AIAA J. 1 (1963) 138): each rank eliminates the nodes that it alone
// holds, and a dense matrix is left of those that ranks share. A solution takes as long as reading the factors, hence
// single precision, which CHOLMOD has since 5.1. The build leaves this class out where there is no such library.
#pragma once

#include "linear.hpp"

#include <suitesparse/cholmod.h>

#include <memory>
#include <vector>

namespace asperity
{
/// Factors L L^T of one rank's part of a symmetric matrix with three dofs a node, on the square graph of its nodes.
class Cholesky
{
public:
  /// Whether the library that is loaded has single precision, as the one built against.
  static bool available() { return cholmod_version(nullptr) >= CHOLMOD_VER_CODE(5, 1); }

  /// Order of elimination and structure of the factors. The nodes of `interface` come last, in that order.
  Cholesky(const Graph& indptr, const Graph& indices, const Array<const int>& interface);

  /// Factorise; false where the matrix is not positive definite to this precision, or memory too small. One rank's part
  /// alone may be singular at the interface, so its diagonal gets `shift` (3 interface,) there.
  bool factorise(const Array<const double>& values, const Array<const float>& shift);

  /// Factor, its lower half only, of the Schur complement at the interface (3 interface, 3 interface), shift included.
  void interface_factors(const Array<float>& out) const;

  /// Solve L y = b, b (dofs,) in the order of the nodes, y in that of elimination.
  void forward(const Array<const float>& b, const Array<float>& y);

  /// Solve L^T x = y in the orders of `forward`; overwrites y.
  void backward(const Array<float>& y, const Array<float>& x);

private:
  struct Library : cholmod_common // made first and removed last: all that CHOLMOD allocates needs it
  {
    Library();
    ~Library();
    Library(const Library&) = delete;
    Library& operator=(const Library&) = delete;
  };
  struct Release
  {
    cholmod_common* library;
    void operator()(cholmod_sparse* object) const { cholmod_free_sparse(&object, library); }
    void operator()(cholmod_factor* object) const { cholmod_free_factor(&object, library); }
  };
  struct Dense // workspace of solutions
  {
    cholmod_common* library;
    cholmod_dense* array = nullptr;
    ~Dense() { cholmod_free_dense(&array, library); }
  };
  using Sparse = std::unique_ptr<cholmod_sparse, Release>;
  using Factor = std::unique_ptr<cholmod_factor, Release>;

  Sparse allocate(std::size_t n, std::size_t entries, int kind);
  Factor analyse(cholmod_sparse& of, std::vector<int>* order);
  std::vector<int> elimination_order(const Graph& indptr, const Graph& indices);
  void expand(const Graph& indptr, const Graph& indices);
  bool fill(const Array<const double>& values, const Array<const float>& shift);
  void solve(int system, float* values);

  Library library;
  std::size_t dofs = 0, interior = 0; // all, and those that are eliminated
  std::size_t given = 0;              // number of values of the matrix from outside
  std::vector<int> interface;
  std::vector<char> shared;                  // whether a node is of the interface
  Sparse matrix{nullptr, Release{&library}}; // upper half by columns
  Factor factor{nullptr, Release{&library}};
  Dense found{&library}, work{&library}, more{&library};
  std::vector<std::size_t> source;   // place of each entry of the matrix among the values
  std::vector<std::size_t> diagonal; // place of each diagonal entry in the matrix
};
} // namespace asperity
