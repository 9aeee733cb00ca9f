#include "bindings.hpp"
#include "flexspline/batch/replay.hpp"

namespace flexspline::bindings {

void bind_estimators(py::module_& module) {
  module.def(
      "replay_differentiator",
      [](const Array& time, const Array& position, double bandwidth) {
        const auto size = static_cast<std::size_t>(position.size());
        column_or_null(time, size, "time");
        py::array_t<double> velocity(position.size());
        py::array_t<double> acceleration(position.size());
        batch::replay_differentiator(time.data(), position.data(), size, {bandwidth},
                                     velocity.mutable_data(), acceleration.mutable_data());
        return py::make_tuple(velocity, acceleration);
      },
      py::arg("time"), py::arg("position"), py::arg("bandwidth"),
      "Velocity and acceleration of each row by the causal differentiator of the core.");
}

}  // namespace flexspline::bindings
