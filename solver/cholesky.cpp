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
  expand(indptr, indices);
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
  library.postorder = order == nullptr; // which would move parts of the interface forward
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

/// The matrix by columns of its upper half, and where its entries come from.
void Cholesky::expand(const Graph& indptr, const Graph& indices)
{
  matrix = allocate(dofs, given, CHOLMOD_REAL);
  int *starts = static_cast<int*>(matrix->p), *rows = static_cast<int*>(matrix->i), size = 0;
  for (std::size_t j = 0; j < shared.size(); ++j)
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
          source.push_back(9 * static_cast<std::size_t>(first) + 3 * (c * width + k) + r);
        }
        if (i == static_cast<int>(j))
          diagonal.push_back(source.size() - 1);
      }
    }
  }
  starts[dofs] = size;
}

bool Cholesky::factorise(const Array<const double>& values, const Array<const float>& shift)
{
  expect("values", values, {given});
  expect("shift", shift, {dofs - interior});
  if (!fill(values, shift))
    return false;
  cholmod_factorize(matrix.get(), factor.get(), &library);
  if (library.status == CHOLMOD_OUT_OF_MEMORY || library.status == CHOLMOD_TOO_LARGE)
    return false;
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
    entries[k] = static_cast<float>(values.data()[source[k]]);
  for (std::size_t k = 0; k < shift.size(); ++k)
    entries[diagonal[3 * interface[k / 3] + k % 3]] += shift.data()[k];
  return std::all_of(entries, entries + source.size(), [](float a) { return std::isfinite(a); });
}

void Cholesky::interface_factors(const Array<float>& out) const
{
  expect("out", out, {dofs - interior, dofs - interior});
  // of a supernode, dense columns with common rows, the first rows are those of its columns
  const std::size_t size = dofs - interior;
  const int *super = static_cast<int*>(factor->super), *at = static_cast<int*>(factor->pi),
            *start = static_cast<int*>(factor->px), *row = static_cast<int*>(factor->s);
  for (std::size_t s = 0; s < factor->nsuper; ++s)
    for (int j = super[s]; j < super[s + 1]; ++j)
    {
      if (j < static_cast<int>(interior))
        continue;
      const int rows = at[s + 1] - at[s], skip = j - super[s];
      const float* column = static_cast<float*>(factor->x) + start[s] + static_cast<std::ptrdiff_t>(skip) * rows;
      for (int i = skip; i < rows; ++i)
        out.data()[(row[at[s] + i] - interior) * size + j - interior] = column[i];
    }
}

/// Solve a system of the factors in place.
void Cholesky::solve(int system, float* values)
{
  cholmod_dense right{};
  right.nrow = right.nzmax = right.d = dofs;
  right.ncol = 1;
  right.x = values;
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_SINGLE;
  if (!cholmod_solve2(system, factor.get(), &right, nullptr, &found.array, nullptr, &work.array, &more.array, &library))
    throw std::bad_alloc();
  std::copy_n(static_cast<float*>(found.array->x), dofs, values);
}

void Cholesky::forward(const Array<const float>& b, const Array<float>& y)
{
  expect("b", b, {dofs});
  expect("y", y, {dofs});
  const int* order = static_cast<int*>(factor->Perm);
  for (std::size_t i = 0; i < dofs; ++i)
    y.data()[i] = b.data()[order[i]];
  solve(CHOLMOD_L, y.data());
}

void Cholesky::backward(const Array<float>& y, const Array<float>& x)
{
  expect("y", y, {dofs});
  expect("x", x, {dofs});
  solve(CHOLMOD_Lt, y.data());
  const int* order = static_cast<int*>(factor->Perm);
  for (std::size_t i = 0; i < dofs; ++i)
    x.data()[order[i]] = y.data()[i];
}
} // namespace asperity
#endif
