#include "bindings.hpp"
#include "host/kernels.hpp"

PYBIND11_MODULE(_core, module) {
  using namespace flexspline::bindings;
  module.doc() = "The C++ core of flexspline: effects, sums, solves and estimators.";
  bind_catalogue(module);
  bind_design(module);
  bind_screening(module);
  bind_solve(module);
  bind_filters(module);
  bind_estimators(module);
  bind_joint(module);
  bind_stages(module);
  bind_sensor(module);
  bind_full_range(module);
  bind_simulation(module);
  bind_forward(module);
  module.def(
      "isa", [] { return std::string(flexspline::batch::isa()); },
      "Name of the instruction set in use: 'baseline', 'v3' or 'v4'.");
}
