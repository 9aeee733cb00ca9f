/// The kernels of one instruction set. This file is compiled once per set, each time with its own
/// -march and with FLEXSPLINE_KERNEL_TABLE naming the table: see lanes.hpp for why all else is
/// internal, and dispatch.cpp for the choice.
#include "host/kernels.hpp"

#include "host/cosine_kernel.hpp"
#include "host/double_double_kernel.hpp"
#include "host/gram_kernel.hpp"
#include "host/trig_kernel.hpp"

namespace flexspline::batch {

extern const Kernels FLEXSPLINE_KERNEL_TABLE;
const Kernels FLEXSPLINE_KERNEL_TABLE{gram, gram_double_double, trig_sums, cosine_and_sine};

}  // namespace flexspline::batch
