// Kernels of the linear solver: products, and the coarse matrix of its multigrid.
#pragma once

#include "cells.hpp"

namespace asperity
{
/// Add the kernels to the Python module.
void bind_linear(nb::module_& m);
} // namespace asperity
