// Cholesky factors of a coarse matrix, see cholesky.hpp.
#ifdef ASPERITY_CHOLMOD
#include "cholesky.hpp"

#include <algorithm>
#include <new>
#include <stdexcept>
#include <string>

namespace asperity
{
namespace
{
/// Raise what CHOLMOD has found wrong.
[[noreturn]] void fail(const cholmod_common& library)
{
  if (library.status == CHOLMOD_OUT_OF_MEMORY || library.status == CHOLMOD_TOO_LARGE)
    throw std::bad_alloc();
  const int version = cholmod_version(nullptr);
  throw std::runtime_error("CHOLMOD " + std::to_string(version / 1000) + "." + std::to_string(version % 1000)
                           + " failed, status " + std::to_string(library.status)
                           + ": build asperity again with the library that is loaded");
}
} // namespace

Cholesky::Library::Library() : cholmod_common{}
{
  cholmod_start(this);
  supernodal = CHOLMOD_SUPERNODAL;
  quick_return_if_not_posdef = 1;
  print = 0; // a failure is reported by the caller
}

Cholesky::Library::~Library()
{
  cholmod_finish(this);
}

/// The matrix as CHOLMOD takes it, which only reads it; without values its graph.
cholmod_sparse Cholesky::view(const Graph& starts, const Graph& rows, const float* values)
{
  cholmod_sparse out{};
  out.nrow = out.ncol = starts.shape(0) - 1;
  out.nzmax = rows.shape(0);
  out.p = const_cast<int*>(starts.data());
  out.i = const_cast<int*>(rows.data());
  out.x = const_cast<float*>(values);
  out.stype = out.sorted = out.packed = 1;
  out.itype = CHOLMOD_INT;
  out.xtype = values ? CHOLMOD_REAL : CHOLMOD_PATTERN;
  out.dtype = CHOLMOD_SINGLE;
  return out;
}

/// Structure of the factors in a given order, or without one in the best.
Cholesky::Factor Cholesky::analyse(const Graph& starts, const Graph& rows, const int* order, Library& library)
{
  expect_graph("starts", starts, "rows", rows);
  check_range("rows", rows, starts.shape(0) - 1);
  cholmod_sparse of = view(starts, rows, nullptr);
  library.nmethods = order ? 1 : 3;
  library.postorder = order == nullptr; // which would move the last ones forward
  Factor out(cholmod_analyze_p(&of, const_cast<int*>(order), nullptr, 0, &library), Release{&library});
  if (!out)
    fail(library);
  return out;
}

void Cholesky::best_order(const Graph& starts, const Graph& rows, const Array<int>& order)
{
  expect("order", order, {starts.shape(0) - 1});
  Library library;
  const Factor structure = analyse(starts, rows, nullptr, library);
  std::copy_n(static_cast<int*>(structure->Perm), order.shape(0), order.data());
}

Cholesky::Cholesky(const Graph& starts, const Graph& rows, const Array<const int>& order) : starts(starts), rows(rows)
{
  const std::size_t n = starts.shape(0) - 1;
  expect("order", order, {n});
  check_range("order", order, n);
  factor = analyse(starts, rows, order.data(), library);
  if (!std::equal(order.data(), order.data() + n, static_cast<int*>(factor->Perm)))
    throw std::logic_error("CHOLMOD has changed the order");
}

bool Cholesky::factorise(const Array<const float>& values)
{
  expect("values", values, {rows.shape(0)});
  cholmod_sparse matrix = view(starts, rows, values.data());
  cholmod_factorize(&matrix, factor.get(), &library);
  if (library.status == CHOLMOD_OUT_OF_MEMORY || library.status == CHOLMOD_TOO_LARGE)
    return false;
  if (library.status != CHOLMOD_OK && library.status != CHOLMOD_NOT_POSDEF)
    fail(library);
  return library.status == CHOLMOD_OK && factor->minor == factor->n;
}

void Cholesky::last_block(const Array<float>& out) const
{
  const std::size_t size = out.shape(0);
  expect("out", out, {size, size});
  if (size > factor->n)
    throw std::invalid_argument("out has more rows than the factors");
  const int before = static_cast<int>(factor->n - size);
  // of a supernode, dense columns with common rows, the first rows are those of its columns
  const int *super = static_cast<int*>(factor->super), *at = static_cast<int*>(factor->pi),
            *start = static_cast<int*>(factor->px), *row = static_cast<int*>(factor->s);
  for (std::size_t s = 0; s < factor->nsuper; ++s)
    for (int j = std::max(super[s], before); j < super[s + 1]; ++j)
    {
      const int count = at[s + 1] - at[s], skip = j - super[s];
      const float* column = static_cast<float*>(factor->x) + start[s] + static_cast<std::ptrdiff_t>(skip) * count;
      for (int i = skip; i < count; ++i)
        out.data()[(row[at[s] + i] - before) * size + j - before] = column[i];
    }
}

void Cholesky::solve(const Array<float>& x, bool transposed)
{
  expect("x", x, {factor->n});
  cholmod_dense right{};
  right.nrow = right.nzmax = right.d = factor->n;
  right.ncol = 1;
  right.x = x.data();
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_SINGLE;
  if (!cholmod_solve2(transposed ? CHOLMOD_Lt : CHOLMOD_L, factor.get(), &right, nullptr, &found.array, nullptr,
                      &work.array, &more.array, &library))
    fail(library);
  std::copy_n(static_cast<float*>(found.array->x), factor->n, x.data());
}
} // namespace asperity
#endif
