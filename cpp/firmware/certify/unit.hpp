/// The exported model as one translation unit, as it would stand in a controller's own program.
///
/// What `step` needs, and nothing else, is what the certificate counts as code, memory and
/// instructions; `take` and `give` are the certificate's own. Two sources have these functions:
/// joint_unit.cpp for an exported chain of estimators, model_unit.cpp for a part's model.
#pragma once

#include "rows.hpp"

#ifndef FLEXSPLINE_SCALAR
#define FLEXSPLINE_SCALAR float
#endif

namespace unit {

using Scalar = FLEXSPLINE_SCALAR;

/// A row becomes the readings of the next step; a fresh start forgets what was.
void take(const certify::Row<Scalar>& row) noexcept;

/// The outputs after the last step.
void give(certify::Result<Scalar>& result) noexcept;

}  // namespace unit

/// One control period.
extern "C" flexspline::Status flexspline_step() noexcept;
