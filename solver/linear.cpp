// Kernels of the linear solver. The time of a product is that of reading the matrix: of a symmetric one the upper half
// is read, in single precision where few digits are enough. All matrices have three dofs a node;
// `values` holds the three rows of a node one after the other, as PETSc's AIJ does.
#include "linear.hpp"

#include <algorithm>
#include <cstring>

namespace asperity
{
namespace
{
using Graph = Array1<const int>;

/// y = A x.
void product(Graph indptr, Graph indices, Array1<const double> values, Array2<const double> x, Array2<double> y)
{
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

/// Blocks of the upper half row by row, the diagonal ones first in theirs, the columns of each one after the other.
void upper_half(Graph indptr, Graph indices, Array1<const double> values, Array1<float> out)
{
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

using Four = float __attribute__((vector_size(16))); // three components and one to spare

Four load(const float* at)
{
  Four out;
  std::memcpy(&out, at, sizeof(out));
  return out;
}

/// y = A x for the symmetric A whose upper half is given by the columns of its blocks (blocks, 9) and one float behind;
/// the graph is that of the upper half. `work` (2, nodes, 4) is overwritten.
void symmetric_product(Graph indptr, Graph indices, Array1<const float> blocks, Array2<const float> x, Array3<float> work,
                       Array2<float> y)
{
  const std::size_t count = x.shape(0);
  float *from = work.data(), *to = from + 4 * count;
  for (std::size_t node = 0; node < count; ++node)
    for (int i = 0; i < 4; ++i)
    {
      from[4 * node + i] = i < 3 ? x.data()[3 * node + i] : 0.0f;
      to[4 * node + i] = 0.0f;
    }
  const float* block = blocks.data();
  for (std::size_t node = 0; node < count; ++node)
  {
    const Four xi = load(from + 4 * node), zero{};
    Four yi{};
    const int first = indptr.data()[node];
    for (int k = first; k < indptr.data()[node + 1]; ++k, block += 9)
    {
      const std::ptrdiff_t other = 4 * static_cast<std::ptrdiff_t>(indices.data()[k]);
      const Four a = load(block), b = load(block + 3), c = load(block + 6);
      const float* xj = from + other;
      yi += a * xj[0] + b * xj[1] + c * xj[2];
      if (k == first)
        continue; // the diagonal
      // the inner products of xi with the three columns: their terms sorted by component, and added
      const Four ax = a * xi, bx = b * xi, cx = c * xi;
      const Four low = __builtin_shufflevector(ax, bx, 0, 4, 1, 5), high = __builtin_shufflevector(ax, bx, 2, 6, 3, 7);
      Four yj = load(to + other);
      yj += __builtin_shufflevector(low, __builtin_shufflevector(cx, zero, 0, 4, 1, 4), 0, 1, 4, 5);
      yj += __builtin_shufflevector(low, __builtin_shufflevector(cx, zero, 0, 4, 1, 4), 2, 3, 6, 7);
      yj += __builtin_shufflevector(high, __builtin_shufflevector(cx, zero, 2, 4, 3, 4), 0, 1, 4, 5);
      std::memcpy(to + other, &yj, sizeof(yj));
    }
    yi += load(to + 4 * node);
    std::memcpy(to + 4 * node, &yi, sizeof(yi));
  }
  for (std::size_t node = 0; node < count; ++node)
    std::copy_n(to + 4 * node, 3, y.data() + 3 * node);
}

/// Take the image of the last step from the residual at the free dofs, and go on by keep * step + add * scaling * residual.
void relax(Array1<const float> image, Array1<const float> free, Array1<const float> scaling, float keep, float add,
           Array1<float> residual, Array1<float> step, Array1<float> x)
{
  const float *const A = image.data(), *const F = free.data(), *const D = scaling.data();
  float *const r = residual.data(), *const s = step.data(), *const y = x.data();
#pragma omp simd
  for (std::size_t i = 0; i < x.size(); ++i)
  {
    r[i] -= F[i] * A[i];
    s[i] = keep * s[i] + add * D[i] * r[i];
    y[i] += s[i];
  }
}

/// Galerkin's coarse matrix (m P c)^T A (m P c): `kept` (nodes, 3) is the mask m, `coarse_kept` the mask c, and P gives
/// each node the mean of its two `parents` (nodes, 2), which are the same for a node of the coarse level.
void galerkin(Graph indptr, Graph indices, Array1<const double> values, Array2<const double> kept,
              Array2<const int> parents, Graph coarse_indptr, Graph coarse_indices, Array2<const double> coarse_kept,
              Array1<double> coarse)
{
  std::fill_n(coarse.data(), coarse.size(), 0.0);
  std::vector<int> place(coarse_indptr.shape(0)); // of a column in the current coarse row
  for (std::size_t node = 0; node + 1 < indptr.shape(0); ++node)
  {
    const int first = indptr.data()[node], width = indptr.data()[node + 1] - first;
    const double* rows = values.data() + 9 * static_cast<std::ptrdiff_t>(first);
    const double* mine = kept.data() + 3 * node;
    const int* up = parents.data() + 2 * node;
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
      for (int k = 0; k < width; ++k)
      {
        const std::ptrdiff_t other = indices.data()[first + k];
        const double* theirs = kept.data() + 3 * other;
        const int* across = parents.data() + 2 * other;
        const int counted = across[0] == across[1] ? 1 : 2;
        const double share = 1.0 / counted;
        for (int q = 0; q < counted; ++q)
        {
          const double* beyond = coarse_kept.data() + 3 * static_cast<std::ptrdiff_t>(across[q]);
          const double right[3] = {share * theirs[0] * beyond[0], share * theirs[1] * beyond[1],
                                   share * theirs[2] * beyond[2]};
          double* to = out + 3 * place[across[q]];
          const double* from = rows + 3 * k;
          for (int i = 0; i < 3; ++i, to += 3 * size, from += 3 * width)
            for (int j = 0; j < 3; ++j)
              to[j] += left[i] * from[j] * right[j];
        }
      }
    }
  }
}
} // namespace

void bind_linear(nb::module_& m)
{
  m.def("product", &product, nb::arg("indptr"), nb::arg("indices"), nb::arg("values"), nb::arg("x"), nb::arg("y"));
  m.def("upper_half", &upper_half, nb::arg("indptr"), nb::arg("indices"), nb::arg("values"), nb::arg("out"));
  m.def("symmetric_product", &symmetric_product, nb::arg("indptr"), nb::arg("indices"), nb::arg("blocks"),
        nb::arg("x"), nb::arg("work"), nb::arg("y"));
  m.def("relax", &relax, nb::arg("image"), nb::arg("free"), nb::arg("scaling"), nb::arg("keep"), nb::arg("add"),
        nb::arg("residual"), nb::arg("step"), nb::arg("x"));
  m.def("galerkin", &galerkin, nb::arg("indptr"), nb::arg("indices"), nb::arg("values"), nb::arg("kept"),
        nb::arg("parents"), nb::arg("coarse_indptr"), nb::arg("coarse_indices"), nb::arg("coarse_kept"), nb::arg("coarse"));
}
} // namespace asperity
