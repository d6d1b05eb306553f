// Matrix times vector in single precision: the smoother of a preconditioner needs no more digits, and its time is
// that of reading the matrix.
#include "product.hpp"

#include <vector>

namespace asperity
{
namespace
{
/// y = A x with three dofs a node; `values` holds the three rows of a node one after the other, as PETSc's AIJ does.
void product(Array1<const int> indptr, Array1<const int> indices, Array1<const float> values, Array2<const float> x,
             Array2<float> y)
{
  std::vector<float> gathered;
  const float* a = values.data();
  for (std::size_t node = 0; node + 1 < indptr.shape(0); ++node)
  {
    const int first = indptr.data()[node], width = indptr.data()[node + 1] - first;
    gathered.resize(3 * static_cast<std::size_t>(width));
    for (int k = 0; k < width; ++k)
      for (int i = 0; i < 3; ++i)
        gathered[3 * k + i] = x.data()[3 * static_cast<std::ptrdiff_t>(indices.data()[first + k]) + i];
    const float* g = gathered.data();
    for (int row = 0; row < 3; ++row, a += 3 * width)
    {
      float sum = 0.0f;
#pragma omp simd reduction(+ : sum)
      for (int k = 0; k < 3 * width; ++k)
        sum += a[k] * g[k];
      y.data()[3 * node + row] = sum;
    }
  }
}
} // namespace

void bind_product(nb::module_& m)
{
  m.def("product", &product, nb::arg("indptr"), nb::arg("indices"), nb::arg("values"), nb::arg("x"), nb::arg("y"));
}
} // namespace asperity
