#include "bindings.hpp"
#include "host/replay_structural_damping.hpp"

namespace flexspline::bindings {

void bind_full_range(py::module_& module) {
  module.def(
      "structural_damping_torque",
      [](const Array& time, const Array& torsion, double damping, double time_constant,
         double initial_torque, double threshold) {
        const auto size = static_cast<std::size_t>(torsion.size());
        column_or_null(time, size, "time");
        py::array_t<double> torque(torsion.size());
        batch::replay_structural_damping(time.data(), torsion.data(), size,
                                         {damping, time_constant, initial_torque, threshold},
                                         torque.mutable_data());
        return torque;
      },
      py::arg("time"), py::arg("torsion"), py::kw_only(), py::arg("damping"),
      py::arg("time_constant"), py::arg("initial_torque"), py::arg("threshold"),
      "Outward torque [Nm] of each row from the rate of the torsion [rad at the output].");
}

}  // namespace flexspline::bindings
