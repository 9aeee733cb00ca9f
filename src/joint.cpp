#include <limits>

#include "bindings.hpp"
#include "flexspline/torsion.hpp"

namespace flexspline::bindings {
namespace {

/// NaN where an angle or the rest is not finite.
double left(const Gear<double>& gear, double ratio, double q, double theta, double rest) noexcept {
  Angle<double> output;
  Angle<double> motor;
  if (read_radians(q, output) != Status::ok || read_radians(theta, motor) != Status::ok ||
      !math::is_finite(rest)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return mesh_torsion_left(gear, ratio, output, motor.phase, rest);
}

py::array_t<double> torsion(const Array& output_position, const Array& motor_position,
                            const Array& rest, double effective_ratio) {
  const auto size = static_cast<std::size_t>(output_position.size());
  const double* motor = column_or_null(motor_position, size, "motor_position");
  const double* known = column_or_null(rest, size, "rest");
  const auto gear = Gear<double>::from_ratio(effective_ratio, OutputSpline::unknown, true);
  py::array_t<double> out(output_position.size());
  const double* output = output_position.data();
  double* values = out.mutable_data();
  for (std::size_t i = 0; i < size; ++i) {
    values[i] = left(gear, effective_ratio, output[i], motor[i], known[i]);
  }
  return out;
}

}  // namespace

void bind_joint(py::module_& module) {
  module.def("mesh_torsion_left", &torsion, py::arg("output_position"), py::arg("motor_position"),
             py::arg("rest"), py::kw_only(), py::arg("effective_ratio"),
             R"(Torsion of the mesh [rad at the output]: what is left of q·ratio − θ after `rest`
[rad at the motor], the short way round.)");
}

}  // namespace flexspline::bindings
