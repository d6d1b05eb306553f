// Kernels of the linear solver. The time of a product is that of reading the matrix: of a symmetric one the upper half
// is read, in single precision where few digits are enough. All matrices have three dofs a node;
// `values` holds the three rows of a node one after the other, as PETSc's AIJ does.
#include "linear.hpp"

#include <algorithm>

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

/// Blocks of the upper half row by row, the diagonal ones first in theirs, out (blocks, 9).
void upper_half(Graph indptr, Graph indices, Array1<const double> values, Array2<float> out)
{
  float* block = out.data();
  for (std::size_t node = 0; node + 1 < indptr.shape(0); ++node)
  {
    const int first = indptr.data()[node], width = indptr.data()[node + 1] - first;
    const double* rows = values.data() + 9 * static_cast<std::ptrdiff_t>(first);
    for (int k = 0; k < width; ++k)
      if (indices.data()[first + k] >= static_cast<int>(node))
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            *block++ = static_cast<float>(rows[3 * (i * width + k) + j]);
  }
}

/// y = A x for the symmetric A whose upper half is given; the graph is that of the upper half.
void symmetric_product(Graph indptr, Graph indices, Array2<const float> blocks, Array2<const float> x, Array2<float> y)
{
  std::fill_n(y.data(), y.size(), 0.0f);
  const float* a = blocks.data();
  for (std::size_t node = 0; node + 1 < indptr.shape(0); ++node)
  {
    const float* xi = x.data() + 3 * node;
    const float x0 = xi[0], x1 = xi[1], x2 = xi[2];
    float y0 = a[0] * x0 + a[1] * x1 + a[2] * x2;
    float y1 = a[3] * x0 + a[4] * x1 + a[5] * x2;
    float y2 = a[6] * x0 + a[7] * x1 + a[8] * x2;
    a += 9;
    for (int k = indptr.data()[node] + 1; k < indptr.data()[node + 1]; ++k, a += 9)
    {
      const std::ptrdiff_t other = 3 * static_cast<std::ptrdiff_t>(indices.data()[k]);
      const float* xj = x.data() + other;
      float* yj = y.data() + other;
      y0 += a[0] * xj[0] + a[1] * xj[1] + a[2] * xj[2];
      y1 += a[3] * xj[0] + a[4] * xj[1] + a[5] * xj[2];
      y2 += a[6] * xj[0] + a[7] * xj[1] + a[8] * xj[2];
      yj[0] += a[0] * x0 + a[3] * x1 + a[6] * x2;
      yj[1] += a[1] * x0 + a[4] * x1 + a[7] * x2;
      yj[2] += a[2] * x0 + a[5] * x1 + a[8] * x2;
    }
    float* yi = y.data() + 3 * node;
    yi[0] += y0;
    yi[1] += y1;
    yi[2] += y2;
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
        nb::arg("x"), nb::arg("y"));
  m.def("galerkin", &galerkin, nb::arg("indptr"), nb::arg("indices"), nb::arg("values"), nb::arg("kept"),
        nb::arg("parents"), nb::arg("coarse_indptr"), nb::arg("coarse_indices"), nb::arg("coarse_kept"), nb::arg("coarse"));
}
} // namespace asperity
