#pragma once

#include <string>

#include "bindings.hpp"
#include "flexspline/estimators/stages.hpp"

namespace flexspline::bindings {

using StagesConfig = AnyStages<double>;

/// The stages of a chain, as `model.json` has them.
StagesConfig stages_from(const py::dict& entries);

[[noreturn]] void refuse(const std::string& sentence);

}  // namespace flexspline::bindings
