// Kernels of the multigrid preconditioner: coarse matrix, and smoothing in single precision.
#pragma once

#include "cells.hpp"

namespace asperity
{
/// Add the kernels to the Python module.
void bind_multigrid(nb::module_& m);
} // namespace asperity
