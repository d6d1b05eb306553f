// Kernels of the linear solver, see linear.hpp.
#include "linear.hpp"

#include <algorithm>
#include <cstring>
#include <vector>

// A function is compiled for newer processors as well, and the one that fits is taken at the start.
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__) && !defined(__AVX2__)
#define FOR_SEVERAL_PROCESSORS __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define FOR_SEVERAL_PROCESSORS
#endif

namespace asperity
{
namespace
{
using Four = float __attribute__((vector_size(16)));  // three components and one to spare
using Eight = float __attribute__((vector_size(32))); // the same of two nodes

Four load(const float* at)
{
  Four out;
  std::memcpy(&out, at, sizeof(out));
  return out;
}

void store(Four value, float* at) { std::memcpy(at, &value, sizeof(value)); }

[[gnu::always_inline]] inline Eight join(Four one, Four other)
{
  return __builtin_shufflevector(one, other, 0, 1, 2, 3, 4, 5, 6, 7);
}

[[gnu::always_inline]] inline Eight load(const float* one, const float* other) { return join(load(one), load(other)); }

[[gnu::always_inline]] inline Four first(Eight pair) { return __builtin_shufflevector(pair, pair, 0, 1, 2, 3); }

[[gnu::always_inline]] inline Four second(Eight pair) { return __builtin_shufflevector(pair, pair, 4, 5, 6, 7); }

/// The columns a, b, c of two blocks times vectors.
[[gnu::always_inline]] inline Eight times(Eight a, Eight b, Eight c, Eight x)
{
  return a * __builtin_shufflevector(x, x, 0, 0, 0, 0, 4, 4, 4, 4)
         + b * __builtin_shufflevector(x, x, 1, 1, 1, 1, 5, 5, 5, 5)
         + c * __builtin_shufflevector(x, x, 2, 2, 2, 2, 6, 6, 6, 6);
}

/// The inner products of vectors with the columns a, b, c of two blocks: their terms sorted by component, and added.
[[gnu::always_inline]] inline Eight transposed_times(Eight a, Eight b, Eight c, Eight x)
{
  const Eight ax = a * x, bx = b * x, cx = c * x, zero{};
  const Eight ab = __builtin_shufflevector(ax, bx, 0, 8, 1, 9, 4, 12, 5, 13);
  const Eight c0 = __builtin_shufflevector(cx, zero, 0, 8, 1, 9, 4, 12, 5, 13);
  const Eight ab_third = __builtin_shufflevector(ax, bx, 2, 10, 3, 11, 6, 14, 7, 15);
  const Eight c0_third = __builtin_shufflevector(cx, zero, 2, 10, 3, 11, 6, 14, 7, 15);
  return __builtin_shufflevector(ab, c0, 0, 1, 8, 9, 4, 5, 12, 13)
         + __builtin_shufflevector(ab, c0, 2, 3, 10, 11, 6, 7, 14, 15)
         + __builtin_shufflevector(ab_third, c0_third, 0, 1, 8, 9, 4, 5, 12, 13);
}

/// Number of nodes of a matrix; refuses inconsistent parts.
std::size_t expect_matrix(const Graph& indptr, const Graph& indices, const Array<const double>& values)
{
  expect_graph("indptr", indptr, "indices", indices);
  expect("values", values, {9 * indices.shape(0)});
  return indptr.shape(0) - 1;
}

/// Add to a matrix with a symmetric graph its transpose.
void add_transpose(const Graph& indptr, const Graph& indices, double* values)
{
  const int *starts = indptr.data(), *columns = indices.data();
  const auto entry = [&](int row, int k, int i, int j) -> double&
  {
    const int width = starts[row + 1] - starts[row];
    return values[9 * static_cast<std::ptrdiff_t>(starts[row]) + 3 * (i * width + k - starts[row]) + j];
  };
  for (int row = 0; row + 1 < static_cast<int>(indptr.shape(0)); ++row)
    for (int k = starts[row]; k < starts[row + 1]; ++k)
    {
      const int column = columns[k];
      if (column < row)
        continue;
      const int across
          = static_cast<int>(std::lower_bound(columns + starts[column], columns + starts[column + 1], row) - columns);
      for (int i = 0; i < 3; ++i)
        for (int j = column == row ? i : 0; j < 3; ++j)
        {
          double &one = entry(row, k, i, j), &other = entry(column, across, j, i);
          one = other = one + other;
        }
    }
}
} // namespace

void product(const Graph& indptr, const Graph& indices, const Array<const double>& values, const Array<const double>& x,
             const Array<double>& y)
{
  const std::size_t nodes = expect_matrix(indptr, indices, values);
  expect("x", x, {nodes, 3});
  expect("y", y, {nodes, 3});
  for (std::size_t node = 0; node + 1 < indptr.shape(0); ++node)
  {
    const int first = indptr.data()[node], width = indptr.data()[node + 1] - first;
    const double* rows = values.data() + 9 * static_cast<std::ptrdiff_t>(first);
    double sums[3]{};
    for (int k = 0; k < width; ++k)
    {
      const double* xj = x.data() + 3 * static_cast<std::ptrdiff_t>(indices.data()[first + k]);
      for (int i = 0; i < 3; ++i)
      {
        const double* a = rows + 3 * (i * width + k);
        sums[i] += a[0] * xj[0] + a[1] * xj[1] + a[2] * xj[2];
      }
    }
    std::copy_n(sums, 3, y.data() + 3 * node);
  }
}

void upper_half(const Graph& indptr, const Graph& indices, const Array<const double>& values, const Array<float>& out)
{
  const std::size_t nodes = expect_matrix(indptr, indices, values);
  expect("out", out, {at_least(9 * ((indices.shape(0) + nodes) / 2))});
  float* block = out.data();
  for (std::size_t node = 0; node + 1 < indptr.shape(0); ++node)
  {
    const int first = indptr.data()[node], width = indptr.data()[node + 1] - first;
    const double* rows = values.data() + 9 * static_cast<std::ptrdiff_t>(first);
    for (int k = 0; k < width; ++k)
      if (indices.data()[first + k] >= static_cast<int>(node))
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i)
            *block++ = static_cast<float>(rows[3 * (i * width + k) + j]);
  }
}

FOR_SEVERAL_PROCESSORS
void symmetric_product(const Graph& indptr, const Graph& indices, const Array<const float>& blocks,
                       const Array<const float>& x, const Array<float>& y)
{
  expect_graph("indptr", indptr, "indices", indices);
  const std::size_t count = indptr.shape(0) - 1;
  expect("blocks", blocks, {at_least(9 * indices.shape(0) + 1)});
  expect("x", x, {count, 4});
  expect("y", y, {count, 4});
  const float* from = x.data();
  float* to = y.data();
  std::fill_n(to, 4 * count, 0.0f);
  const int *starts = indptr.data(), *columns = indices.data();
  const auto at = [columns](int k) { return 4 * static_cast<std::ptrdiff_t>(columns[k]); };
  const float* block = blocks.data();
  for (std::size_t node = 0; node < count; ++node)
  {
    int k = starts[node];
    const int end = starts[node + 1];
    if (k == end)
      continue;
    const Four xi = load(from + 4 * node);
    const Eight xi_twice = join(xi, xi);
    Four yi = load(block) * xi[0] + load(block + 3) * xi[1] + load(block + 6) * xi[2]; // the diagonal block
    Eight sums{};
    ++k, block += 9;
    for (; k + 1 < end; k += 2, block += 18)
    {
      const Eight a = load(block, block + 9), b = load(block + 3, block + 12), c = load(block + 6, block + 15);
      sums += times(a, b, c, load(from + at(k), from + at(k + 1)));
      const Eight yj = transposed_times(a, b, c, xi_twice);
      store(load(to + at(k)) + first(yj), to + at(k));
      store(load(to + at(k + 1)) + second(yj), to + at(k + 1));
    }
    if (k < end) // one is left
    {
      const Four a = load(block), b = load(block + 3), c = load(block + 6), ax = a * xi, bx = b * xi, cx = c * xi;
      const float* xj = from + at(k);
      yi += a * xj[0] + b * xj[1] + c * xj[2];
      store(load(to + at(k)) + Four{ax[0] + ax[1] + ax[2], bx[0] + bx[1] + bx[2], cx[0] + cx[1] + cx[2]}, to + at(k));
      block += 9;
    }
    yi += load(to + 4 * node) + first(sums) + second(sums);
    yi[3] = 0.0f; // a product with what follows a column
    store(yi, to + 4 * node);
  }
}

void relax(const Array<const float>& image, const Array<const float>& free, const Array<const float>& scaling,
           float keep, float add, const Array<float>& residual, const Array<float>& step, const Array<float>& x)
{
  expect("x", x, {any()});
  const std::size_t size = x.shape(0);
  expect("image", image, {size});
  expect("free", free, {size});
  expect("scaling", scaling, {size});
  expect("residual", residual, {size});
  expect("step", step, {size});
  const float *const A = image.data(), *const F = free.data(), *const D = scaling.data();
  float *const r = residual.data(), *const s = step.data(), *const y = x.data();
#pragma omp simd
  for (std::size_t i = 0; i < size; ++i)
  {
    r[i] -= F[i] * A[i];
    s[i] = keep * s[i] + add * D[i] * r[i];
    y[i] += s[i];
  }
}

void galerkin(const Graph& indptr, const Graph& indices, const Matrix& values, const Array<const double>& kept,
              const Array<const int>& parents, const Graph& coarse_indptr, const Graph& coarse_indices,
              const Array<const double>& coarse_kept, const Array<double>& coarse)
{
  const auto* whole = std::get_if<Array<const double>>(&values);
  const auto* half = std::get_if<Array<const float>>(&values);
  expect_graph("indptr", indptr, "indices", indices);
  if (whole)
    expect("values", *whole, {9 * indices.shape(0)});
  else
    expect("values", *half, {at_least(9 * indices.shape(0))});
  const int nodes = static_cast<int>(indptr.shape(0)) - 1;
  expect("kept", kept, {indptr.shape(0) - 1, 3});
  expect("parents", parents, {indptr.shape(0) - 1, 2});
  expect_graph("coarse_indptr", coarse_indptr, "coarse_indices", coarse_indices);
  expect("coarse_kept", coarse_kept, {coarse_indptr.shape(0) - 1, 3});
  expect("coarse", coarse, {9 * coarse_indices.shape(0)});
  std::fill_n(coarse.data(), coarse.size(), 0.0);
  std::vector<int> place(coarse_indptr.shape(0)); // of a column in the current coarse row
  double block[9];
  for (int node = 0; node < nodes; ++node)
  {
    const double* mine = kept.data() + 3 * static_cast<std::ptrdiff_t>(node);
    const int* up = parents.data() + 2 * static_cast<std::ptrdiff_t>(node);
    const int count = up[0] == up[1] ? 1 : 2;
    for (int p = 0; p < count; ++p)
    {
      const int start = coarse_indptr.data()[up[p]], end = coarse_indptr.data()[up[p] + 1], size = end - start;
      double* out = coarse.data() + 9 * static_cast<std::ptrdiff_t>(start);
      for (int k = start; k < end; ++k)
        place[coarse_indices.data()[k]] = k - start;
      const double* above = coarse_kept.data() + 3 * static_cast<std::ptrdiff_t>(up[p]);
      double left[3];
      for (int i = 0; i < 3; ++i)
        left[i] = mine[i] * above[i] / count;
      for (int k = indptr.data()[node]; k < indptr.data()[node + 1]; ++k)
      {
        const std::ptrdiff_t other = indices.data()[k];
        const double* theirs = kept.data() + 3 * other;
        const int* across = parents.data() + 2 * other;
        const int counted = across[0] == across[1] ? 1 : 2;
        const double share = 1.0 / counted;
        if (whole)
        {
          const int first = indptr.data()[node], width = indptr.data()[node + 1] - first;
          const double* rows = whole->data() + 9 * static_cast<std::ptrdiff_t>(first) + 3 * (k - first);
          for (int i = 0; i < 3; ++i)
            std::copy_n(rows + 3 * i * width, 3, block + 3 * i);
        }
        else // with half of the diagonal the matrix is the sum of what is here and its transpose, so is the coarse one
          for (int i = 0; i < 9; ++i)
            block[3 * (i % 3) + i / 3] = (k == indptr.data()[node] ? 0.5 : 1.0)
                                         * static_cast<double>(half->data()[9 * static_cast<std::ptrdiff_t>(k) + i]);
        for (int q = 0; q < counted; ++q)
        {
          const double* beyond = coarse_kept.data() + 3 * static_cast<std::ptrdiff_t>(across[q]);
          const double right[3]
              = {share * theirs[0] * beyond[0], share * theirs[1] * beyond[1], share * theirs[2] * beyond[2]};
          double* to = out + 3 * place[across[q]];
          for (int i = 0; i < 3; ++i, to += 3 * size)
            for (int j = 0; j < 3; ++j)
              to[j] += left[i] * block[3 * i + j] * right[j];
        }
      }
    }
  }
  if (half)
    add_transpose(coarse_indptr, coarse_indices, coarse.data());
}
} // namespace asperity
