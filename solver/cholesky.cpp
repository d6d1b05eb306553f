// Cholesky factors of a coarse matrix, see cholesky.hpp.
#ifdef ASPERITY_CHOLMOD
#include "cholesky.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <string>

namespace asperity
{
namespace
{
/// Supernode of the factors: dense columns with common rows, of which the first are those of the columns.
struct Supernode
{
  int first, columns, rows; // first column, number of columns and rows
  const int* row;           // numbers of the rows
  const float* entries;     // by columns

  Supernode(const cholmod_factor& factor, std::size_t s)
  {
    const int *super = static_cast<int*>(factor.super), *at = static_cast<int*>(factor.pi);
    first = super[s];
    columns = super[s + 1] - first;
    rows = at[s + 1] - at[s];
    row = static_cast<int*>(factor.s) + at[s];
    entries = static_cast<float*>(factor.x) + static_cast<int*>(factor.px)[s];
  }
  const float* column(int j) const { return entries + static_cast<std::ptrdiff_t>(j) * rows; }
  /// Number of columns before column `end` of the factors.
  int before(std::size_t end) const { return std::clamp(static_cast<int>(end) - first, 0, columns); }
};

/// sum -= the first `columns` columns of the rows below the diagonal block times x.
void subtract_below(const Supernode& s, int columns, const float* x, float* sum)
{
  const int skip = s.columns, n = s.rows - skip;
  int j = 0;
  for (; j + 4 <= columns; j += 4)
  {
    const float *a = s.column(j) + skip, *b = s.column(j + 1) + skip, *c = s.column(j + 2) + skip,
               *d = s.column(j + 3) + skip;
#pragma omp simd
    for (int i = 0; i < n; ++i)
      sum[i] -= a[i] * x[j] + b[i] * x[j + 1] + c[i] * x[j + 2] + d[i] * x[j + 3];
  }
  for (; j < columns; ++j)
  {
    const float* a = s.column(j) + skip;
#pragma omp simd
    for (int i = 0; i < n; ++i)
      sum[i] -= a[i] * x[j];
  }
}

/// x -= the transpose of these entries times y.
void subtract_transposed(const Supernode& s, int columns, const float* y, float* x)
{
  const int skip = s.columns, n = s.rows - skip;
  int j = 0;
  for (; j + 4 <= columns; j += 4)
  {
    const float *a = s.column(j) + skip, *b = s.column(j + 1) + skip, *c = s.column(j + 2) + skip,
               *d = s.column(j + 3) + skip;
    float p = 0.0f, q = 0.0f, r = 0.0f, t = 0.0f;
#pragma omp simd reduction(+ : p, q, r, t)
    for (int i = 0; i < n; ++i)
    {
      p += a[i] * y[i];
      q += b[i] * y[i];
      r += c[i] * y[i];
      t += d[i] * y[i];
    }
    x[j] -= p;
    x[j + 1] -= q;
    x[j + 2] -= r;
    x[j + 3] -= t;
  }
  for (; j < columns; ++j)
  {
    const float* a = s.column(j) + skip;
    float p = 0.0f;
#pragma omp simd reduction(+ : p)
    for (int i = 0; i < n; ++i)
      p += a[i] * y[i];
    x[j] -= p;
  }
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

Cholesky::Cholesky(const Graph& indptr, const Graph& indices, const Array<const int>& interface)
{
  expect_graph("indptr", indptr, "indices", indices);
  const std::size_t nodes = indptr.shape(0) - 1;
  check_range("indices", indices, nodes);
  expect("interface", interface, {any()});
  check_range("interface", interface, nodes);
  this->interface.assign(interface.data(), interface.data() + interface.size());
  shared.assign(nodes, 0);
  for (const int node : this->interface)
  {
    if (shared[node])
      throw std::invalid_argument("interface has node " + std::to_string(node) + " twice");
    shared[node] = 1;
  }
  dofs = 3 * nodes;
  given = 9 * indices.shape(0);
  interior = dofs - 3 * interface.size();
  std::vector<int> nodal = elimination_order(indptr, indices), order;
  for (const int node : nodal)
    for (int i = 0; i < 3; ++i)
      order.push_back(3 * node + i);
  expand(indptr, indices, interface_chain(indptr, indices));
  factor = analyse(*matrix, &order);
  const int* found = static_cast<int*>(factor->Perm);
  if (!std::equal(order.begin() + static_cast<std::ptrdiff_t>(interior), order.end(), found + interior))
    throw std::logic_error("CHOLMOD has not left the interface to the end");
}

Cholesky::Sparse Cholesky::allocate(std::size_t n, std::size_t entries, int kind)
{
  Sparse out(cholmod_allocate_sparse(n, n, entries, 0, 1, 1, kind + CHOLMOD_SINGLE, &library), Release{&library});
  if (!out)
    throw std::bad_alloc();
  return out;
}

/// Structure of the factors in a given order, or without one in the best of two: minimum degree, nested dissection.
Cholesky::Factor Cholesky::analyse(cholmod_sparse& of, std::vector<int>* order)
{
  library.nmethods = order ? 1 : 3;
  Factor out(cholmod_analyze_p(&of, order ? order->data() : nullptr, nullptr, 0, &library), Release{&library});
  if (!out)
    throw std::bad_alloc();
  return out;
}

/// All nodes, those of the interface last.
std::vector<int> Cholesky::elimination_order(const Graph& indptr, const Graph& indices)
{
  std::vector<int> number(shared.size(), -1), inner, order;
  for (std::size_t node = 0; node < shared.size(); ++node)
    if (!shared[node])
    {
      number[node] = static_cast<int>(inner.size());
      inner.push_back(static_cast<int>(node));
    }
  if (!inner.empty())
  {
    Sparse graph = allocate(inner.size(), indices.shape(0), CHOLMOD_PATTERN);
    int *starts = static_cast<int*>(graph->p), *rows = static_cast<int*>(graph->i), size = 0;
    for (std::size_t j = 0; j < inner.size(); ++j)
    {
      starts[j] = size;
      for (int k = indptr.data()[inner[j]]; k < indptr.data()[inner[j] + 1]; ++k)
        if (const int i = number[indices.data()[k]]; i >= 0 && i <= static_cast<int>(j))
          rows[size++] = i;
    }
    starts[inner.size()] = size;
    const Factor structure = analyse(*graph, nullptr);
    for (std::size_t k = 0; k < inner.size(); ++k)
      order.push_back(inner[static_cast<int*>(structure->Perm)[k]]);
  }
  order.insert(order.end(), interface.begin(), interface.end());
  return order;
}

/// Couplings by zeros that make the interface the end of the elimination tree, so that CHOLMOD moves none of it forward:
/// each of its nodes with the next one, and its first one with each connected piece of the interior.
Cholesky::Pairs Cholesky::interface_chain(const Graph& indptr, const Graph& indices) const
{
  Pairs out;
  if (interface.empty())
    return out;
  const auto couple = [&](int a, int b)
  {
    const int *row = indices.data() + indptr.data()[a], *end = indices.data() + indptr.data()[a + 1];
    if (std::find(row, end, b) == end) // CHOLMOD allows no entry twice
      out.push_back({a, b});
  };
  for (std::size_t k = 1; k < interface.size(); ++k)
    couple(interface[k - 1], interface[k]);
  std::vector<char> seen = shared;
  std::vector<int> stack;
  for (std::size_t start = 0; start < seen.size(); ++start)
  {
    if (seen[start])
      continue;
    couple(interface[0], static_cast<int>(start));
    stack.push_back(static_cast<int>(start));
    seen[start] = 1;
    while (!stack.empty())
    {
      const int node = stack.back();
      stack.pop_back();
      for (int k = indptr.data()[node]; k < indptr.data()[node + 1]; ++k)
        if (const int next = indices.data()[k]; !seen[next])
        {
          seen[next] = 1;
          stack.push_back(next);
        }
    }
  }
  return out;
}

/// The matrix by columns of its upper half, with zeros at the couplings `more`, and where its entries come from.
void Cholesky::expand(const Graph& indptr, const Graph& indices, const Pairs& more)
{
  const std::size_t nodes = shared.size();
  std::vector<std::vector<int>> zeros(nodes);
  for (const auto& [a, b] : more)
    zeros[std::max(a, b)].push_back(std::min(a, b));
  matrix = allocate(dofs, 9 * (indices.shape(0) + more.size()), CHOLMOD_REAL);
  int *starts = static_cast<int*>(matrix->p), *rows = static_cast<int*>(matrix->i), size = 0;
  for (std::size_t j = 0; j < nodes; ++j)
  {
    const int first = indptr.data()[j], width = indptr.data()[j + 1] - first;
    for (int c = 0; c < 3; ++c)
    {
      starts[3 * j + c] = size;
      for (int k = 0; k < width; ++k)
      {
        const int i = indices.data()[first + k];
        const int end = i < static_cast<int>(j) ? 3 : i == static_cast<int>(j) ? c + 1 : 0;
        for (int r = 0; r < end; ++r)
        {
          rows[size++] = 3 * i + r;
          source.push_back(9 * static_cast<std::ptrdiff_t>(first) + 3 * (c * width + k) + r);
        }
        if (i == static_cast<int>(j))
          diagonal.push_back(source.size() - 1);
      }
      for (const int i : zeros[j])
        for (int r = 0; r < 3; ++r)
        {
          rows[size++] = 3 * i + r;
          source.push_back(-1);
        }
    }
  }
  starts[dofs] = size;
  matrix->sorted = more.empty();
}

bool Cholesky::factorise(const Array<const double>& values, const Array<const float>& shift)
{
  expect("values", values, {given});
  expect("shift", shift, {dofs - interior});
  if (!fill(values, shift))
    return false;
  cholmod_factorize(matrix.get(), factor.get(), &library);
  if (library.status == CHOLMOD_OUT_OF_MEMORY || library.status == CHOLMOD_TOO_LARGE)
    throw std::bad_alloc();
  if (library.status != CHOLMOD_OK && library.status != CHOLMOD_NOT_POSDEF)
    throw std::runtime_error("CHOLMOD " + std::to_string(cholmod_version(nullptr) / 1000) + "." +
                             std::to_string(cholmod_version(nullptr) % 1000) + " failed, status " +
                             std::to_string(library.status) + ": build asperity again with the library that is loaded");
  return library.status == CHOLMOD_OK && factor->minor == dofs;
}

/// Values of the matrix; whether all are finite.
bool Cholesky::fill(const Array<const double>& values, const Array<const float>& shift)
{
  float* entries = static_cast<float*>(matrix->x);
  for (std::size_t k = 0; k < source.size(); ++k)
    entries[k] = source[k] < 0 ? 0.0f : static_cast<float>(values.data()[source[k]]);
  for (std::size_t k = 0; k < shift.size(); ++k)
    entries[diagonal[3 * interface[k / 3] + k % 3]] += shift.data()[k];
  return std::all_of(entries, entries + source.size(), [](float a) { return std::isfinite(a); });
}

void Cholesky::interface_factors(const Array<float>& out) const
{
  expect("out", out, {dofs - interior, dofs - interior});
  const std::size_t size = dofs - interior;
  for (std::size_t k = 0; k < factor->nsuper; ++k)
  {
    const Supernode s(*factor, k);
    for (int j = s.before(interior); j < s.columns; ++j)
      for (int i = j; i < s.rows; ++i)
        out.data()[(s.row[i] - interior) * size + (s.first + j - interior)] = s.column(j)[i];
  }
}

void Cholesky::forward(const Array<const float>& right, const Array<float>& work) const
{
  expect("right", right, {dofs});
  expect("work", work, {dofs});
  const int* order = static_cast<int*>(factor->Perm);
  for (std::size_t i = 0; i < dofs; ++i)
    work.data()[i] = right.data()[order[i]];
  float* x = work.data();
  std::vector<float> below(factor->maxesize + 1);
  for (std::size_t k = 0; k < factor->nsuper; ++k)
  {
    const Supernode s(*factor, k);
    const int columns = s.before(interior), n = s.rows - s.columns;
    if (columns == 0)
      continue;
    float* own = x + s.first;
    for (int j = 0; j < columns; ++j)
    {
      const float* l = s.column(j);
      own[j] /= l[j];
      for (int i = j + 1; i < s.columns; ++i)
        own[i] -= l[i] * own[j];
    }
    std::fill_n(below.begin(), n, 0.0f);
    subtract_below(s, columns, own, below.data());
    for (int i = 0; i < n; ++i)
      x[s.row[s.columns + i]] += below[i];
  }
}

void Cholesky::backward(const Array<float>& work, const Array<float>& x) const
{
  expect("work", work, {dofs});
  expect("x", x, {dofs});
  float* y = work.data();
  std::vector<float> below(factor->maxesize + 1);
  for (std::size_t k = factor->nsuper; k-- > 0;)
  {
    const Supernode s(*factor, k);
    const int columns = s.before(interior), n = s.rows - s.columns;
    if (columns == 0)
      continue;
    float* own = y + s.first;
    for (int i = 0; i < n; ++i)
      below[i] = y[s.row[s.columns + i]];
    subtract_transposed(s, columns, below.data(), own);
    for (int j = columns - 1; j >= 0; --j)
    {
      const float* l = s.column(j);
      float sum = 0.0f;
#pragma omp simd reduction(+ : sum)
      for (int i = j + 1; i < s.columns; ++i)
        sum += l[i] * own[i];
      own[j] = (own[j] - sum) / l[j];
    }
  }
  const int* order = static_cast<int*>(factor->Perm);
  for (std::size_t i = 0; i < dofs; ++i)
    x.data()[order[i]] = y[i];
}
} // namespace asperity
#endif
