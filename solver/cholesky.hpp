// Cholesky factors of a coarse matrix in single precision, by CHOLMOD (Chen et al., ACM Trans. Math. Softw. 35 (2008)
// 22), see asperity/linear/coarse.py. A solution takes as long as reading the factors, hence single precision, which
// CHOLMOD has since 5.1. The build leaves this class out where there is no such library.
#pragma once

#include "linear.hpp"

#include <suitesparse/cholmod.h>

#include <memory>

namespace asperity
{
/// Factors L L^T of a symmetric matrix, given by its upper half by columns: `starts` (n + 1,), rows, values.
class Cholesky
{
public:
  /// Whether the library that is loaded has single precision, as the one built against.
  static bool available() { return cholmod_version(nullptr) >= CHOLMOD_VER_CODE(5, 1); }

  /// Write the best order (n,) of elimination for such a graph, of minimum degree and nested dissection.
  static void best_order(const Graph& starts, const Graph& rows, const Array<int>& order);

  /// Structure of the factors, for elimination in this order (n,).
  Cholesky(const Graph& starts, const Graph& rows, const Array<const int>& order);

  /// Factorise; false where the matrix is not positive definite to this precision, or memory too small.
  bool factorise(const Array<const float>& values);

  /// Copy the last k rows and columns of L, its lower half only, to (k, k).
  void last_block(const Array<float>& out) const;

  /// Solve L y = x in place, or L^T y = x; both in the order of elimination.
  void solve(const Array<float>& x, bool transposed);

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
    void operator()(cholmod_factor* object) const { cholmod_free_factor(&object, library); }
  };
  struct Dense // workspace of solutions
  {
    cholmod_common* library;
    cholmod_dense* array = nullptr;
    ~Dense() { cholmod_free_dense(&array, library); }
  };
  using Factor = std::unique_ptr<cholmod_factor, Release>;

  static cholmod_sparse view(const Graph& starts, const Graph& rows, const float* values);
  static Factor analyse(const Graph& starts, const Graph& rows, const int* order, Library& library);

  Library library;
  Graph starts, rows;
  Factor factor{nullptr, Release{&library}};
  Dense found{&library}, work{&library}, more{&library};
};
} // namespace asperity
