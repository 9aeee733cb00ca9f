#include <algorithm>
#include <stdexcept>
#include <string>

#include "bindings.hpp"
#include "host/replay.hpp"
#include "host/replay_estimators.hpp"

namespace flexspline::bindings {
namespace {

/// f of each element, in the shape of `in`.
template <typename Function>
py::array_t<double> each(const Array& in, Function f) {
  py::array_t<double> out(in.request().shape);
  const double* from = in.data();
  double* to = out.mutable_data();
  const auto size = static_cast<std::size_t>(in.size());
  const py::gil_scoped_release release;
  for (std::size_t i = 0; i < size; ++i) to[i] = f(from[i]);
  return out;
}

template <std::size_t N>
void fill(const std::vector<double>& values, std::array<double, N>& into, const char* name) {
  if (values.size() > N) {
    throw std::invalid_argument(std::to_string(values.size()) + " values of " + name +
                                " are given, room is for " + std::to_string(N));
  }
  std::copy(values.begin(), values.end(), into.begin());
}

std::size_t rows_of(const Array& array) { return static_cast<std::size_t>(array.size()); }

py::tuple differentiate(const Array& time, const Array& position, double bandwidth) {
  const std::size_t size = rows_of(position);
  column_or_null(time, size, "time");
  py::array_t<double> velocity(position.size());
  py::array_t<double> acceleration(position.size());
  batch::replay_differentiator(time.data(), position.data(), size, {bandwidth},
                               velocity.mutable_data(), acceleration.mutable_data());
  return py::make_tuple(velocity, acceleration);
}

py::array_t<double> thermistor_temperature(const Array& voltage, const Thermistor<double>& made) {
  return each(voltage, [&made](double v) {
    double found = batch::unknown;
    return made.temperature(v, found) == Status::ok ? found : batch::unknown;
  });
}

py::array_t<double> thermistor_voltage(const Array& temperature, const Thermistor<double>& made) {
  return each(temperature, [&made](double t) {
    double found = batch::unknown;
    return made.voltage(t, found) == Status::ok ? found : batch::unknown;
  });
}

py::array_t<double> temperature_compensation(const Array& time, const Array& temperature,
                                             const std::vector<double>& coefficients,
                                             double reference_temperature, double gradient,
                                             double thermal_lag) {
  column_or_null(time, rows_of(temperature), "time");
  TemperatureCompensation<double>::Config config;
  fill(coefficients, config.coefficients, "coefficients");
  config.reference_temperature = reference_temperature;
  config.gradient = gradient;
  config.thermal_lag = thermal_lag;
  py::array_t<double> torque(temperature.size());
  batch::replay_temperature_compensation(time.data(), temperature.data(), rows_of(temperature),
                                         config, torque.mutable_data());
  return torque;
}

py::array_t<double> observe_momentum(const Array& time, const Array& momentum,
                                     const Array& known_torque, double gain, bool exact) {
  const std::size_t size = rows_of(momentum);
  column_or_null(time, size, "time");
  column_or_null(known_torque, size, "known_torque");
  if (!(gain > 0)) {
    throw std::invalid_argument("the observer's gain is " + std::to_string(gain) +
                                " 1/s; give one above zero");
  }
  py::array_t<double> external(momentum.size());
  const auto how = exact ? Discretisation::exact : Discretisation::euler;
  const std::size_t row = batch::replay_observer(time.data(), momentum.data(), known_torque.data(),
                                                 size, {gain, how}, external.mutable_data());
  if (row < size) {
    throw std::invalid_argument(
        "the observer's gain of " + std::to_string(gain) +
        " 1/s is not stable by Euler over the period that ends at row " + std::to_string(row) +
        "; gain times period must stay below 2, or take the exact discretisation");
  }
  return external;
}

py::tuple mesh_torques(const Array& torsion, double mesh_stiffness, double mesh_shape,
                       double margin) {
  py::array_t<std::uint8_t> flags(torsion.request().shape);
  std::uint8_t* flag = flags.mutable_data();
  const auto torque = each(torsion, [=](double twist) mutable {
    const auto found = mesh_torque(twist, mesh_stiffness, mesh_shape, margin);
    *flag++ = static_cast<std::uint8_t>(found.flags);
    return found.torque;
  });
  return py::make_tuple(torque, flags);
}

py::tuple hysteretic_torques(const Array& torsion, const Compliance<double>& mesh,
                             double load_width, const std::vector<double>& heights) {
  LoadHysteresis<double> hysteresis{load_width};
  fill(heights, hysteresis.heights, "heights");
  py::array_t<std::uint8_t> flags(torsion.request().shape);
  py::array_t<double> left(torsion.request().shape);
  std::uint8_t* flag = flags.mutable_data();
  double* rest = left.mutable_data();
  LoadHysteresis<double>::State state;
  const auto torque = each(torsion, [&](double twist) {
    FlaggedTorque<double> found{batch::unknown};
    *rest = batch::unknown;
    const Status status = hysteresis.torque(mesh, state, twist, *rest++, found);
    *flag++ = static_cast<std::uint8_t>(found.flags);
    return status == Status::ok ? found.torque : batch::unknown;
  });
  return py::make_tuple(torque, flags, left);
}

py::array_t<double> merge_kalman(const Array& time, const Array& velocity, const Array& observer,
                                 const Array& compliance,
                                 const KalmanMerge<double>::Config& config) {
  const std::size_t size = rows_of(velocity);
  column_or_null(time, size, "time");
  column_or_null(observer, size, "observer");
  column_or_null(compliance, size, "compliance");
  py::array_t<double> merged(velocity.size());
  batch::replay_kalman_merge(time.data(), velocity.data(), observer.data(), compliance.data(), size,
                             config, merged.mutable_data());
  return merged;
}

py::array_t<bool> detect_collision(const Array& time, const Array& residual, const Array& velocity,
                                   const std::vector<double>& speed_edges,
                                   const std::vector<double>& negative,
                                   const std::vector<double>& positive, double release,
                                   double hold) {
  const std::size_t size = rows_of(residual);
  column_or_null(time, size, "time");
  column_or_null(velocity, size, "velocity");
  if (negative.size() != positive.size() || negative.size() != speed_edges.size() + 1) {
    throw std::invalid_argument(
        "negative and positive need one threshold for each band of speed, one more than there are "
        "speed_edges");
  }
  CollisionDetector<double>::Config config;
  fill(negative, config.negative, "negative");
  fill(positive, config.positive, "positive");
  fill(speed_edges, config.speed_edges, "speed_edges");
  config.release = release;
  config.hold = hold;
  py::array_t<bool> contact(residual.size());
  batch::replay_collision_detector(time.data(), residual.data(), velocity.data(), size, config,
                                   contact.mutable_data());
  return contact;
}

void bind_sensor_side(py::module_& module) {
  using Convert = py::array_t<double> (*)(const Array&, const Thermistor<double>&);
  const auto thermistor = [&module](const char* name, const char* from, Convert convert,
                                    const char* doc) {
    module.def(
        name,
        [convert](const Array& values, double supply_voltage, double divider_resistance,
                  double nominal_resistance, double beta, double nominal_temperature) {
          return convert(values, {supply_voltage, divider_resistance, nominal_resistance, beta,
                                  nominal_temperature});
        },
        py::arg(from), py::kw_only(), py::arg("supply_voltage"), py::arg("divider_resistance"),
        py::arg("nominal_resistance"), py::arg("beta"), py::arg("nominal_temperature"), doc);
  };
  thermistor(
      "thermistor_temperature", "voltage", thermistor_temperature,
      "Temperature [°C] from the divider's voltage [V]; NaN where the line is open or short.");
  thermistor("thermistor_voltage", "temperature", thermistor_voltage,
             "The divider's voltage [V] at a temperature [°C]; NaN at absolute zero and below.");
  module.def("temperature_compensation", &temperature_compensation, py::arg("time"),
             py::arg("temperature"), py::kw_only(), py::arg("coefficients"),
             py::arg("reference_temperature"), py::arg("gradient"), py::arg("thermal_lag"),
             "Torque [Nm] to add to each row's reading so that temperature leaves no trace.");
}

void bind_compliance(py::module_& module) {
  module.def(
      "mesh_torsion",
      [](const Array& torque, double mesh_stiffness, double mesh_shape) {
        return each(torque,
                    [=](double load) { return mesh_torsion(load, mesh_stiffness, mesh_shape); });
      },
      py::arg("torque"), py::kw_only(), py::arg("mesh_stiffness"), py::arg("mesh_shape"),
      "Torsion of the mesh [rad at the output] under an outward torque [Nm at the output].");
  module.def("mesh_torque", &mesh_torques, py::arg("torsion"), py::kw_only(),
             py::arg("mesh_stiffness"), py::arg("mesh_shape"), py::arg("margin"),
             "Outward torque [Nm] from the mesh's torsion [rad at the output]: (torque, flags).");
  module.def(
      "hysteretic_mesh_torque",
      [](const Array& torsion, double mesh_stiffness, double mesh_shape, double margin,
         double load_width, const std::vector<double>& heights) {
        return hysteretic_torques(torsion, {mesh_stiffness, mesh_shape, margin}, load_width,
                                  heights);
      },
      py::arg("torsion"), py::kw_only(), py::arg("mesh_stiffness"), py::arg("mesh_shape"),
      py::arg("margin"), py::arg("load_width"), py::arg("heights"),
      R"(Torque of one run whose torsion also remembers the way of the load, row by row:
(torque, flags, torsion of the mesh alone). `heights` [rad at the output] of `load_width` [Nm at
the output], its half, quarter and eighth; NaN where the torsion is not finite.)");
  module.def(
      "wave_generator_torsion",
      [](const Array& motor_torque, double stiffness, double shape) {
        return each(motor_torque,
                    [=](double load) { return wave_generator_torsion(load, stiffness, shape); });
      },
      py::arg("motor_torque"), py::kw_only(), py::arg("stiffness"), py::arg("shape"),
      "Torsion of the wave generator [rad at the motor] under a motor torque [Nm at the motor].");
}

void bind_merge(py::module_& module) {
  module.def(
      "merge_weight",
      [](const Array& velocity, double alpha, double transition_velocity) {
        const LogisticMerge<double> merge{alpha, transition_velocity};
        return each(velocity, [&merge](double v) { return merge.weight(v); });
      },
      py::arg("velocity"), py::kw_only(), py::arg("alpha"), py::arg("transition_velocity"),
      "Share of the observer in the logistic merge at each velocity [rad/s at the output].");
  module.def(
      "merge_kalman",
      [](const Array& time, const Array& velocity, const Array& observer, const Array& compliance,
         double alpha, double transition_velocity, double walk, double observer_rest,
         double observer_motion, double compliance_rest, double compliance_motion) {
        return merge_kalman(time, velocity, observer, compliance,
                            {{alpha, transition_velocity},
                             walk,
                             observer_rest,
                             observer_motion,
                             compliance_rest,
                             compliance_motion});
      },
      py::arg("time"), py::arg("velocity"), py::arg("observer"), py::arg("compliance"),
      py::kw_only(), py::arg("alpha"), py::arg("transition_velocity"), py::arg("walk"),
      py::arg("observer_rest"), py::arg("observer_motion"), py::arg("compliance_rest"),
      py::arg("compliance_motion"),
      "Torque [Nm] that observer and compliance agree on, by a Kalman filter of a random "
      "walk.");
}

}  // namespace

void bind_estimators(py::module_& module) {
  module.def("replay_differentiator", &differentiate, py::arg("time"), py::arg("position"),
             py::arg("bandwidth"),
             "Velocity and acceleration of each row by the causal differentiator of the core.");
  bind_sensor_side(module);
  bind_compliance(module);
  bind_merge(module);
  module.def(
      "observe_momentum", &observe_momentum, py::arg("time"), py::arg("momentum"),
      py::arg("known_torque"), py::kw_only(), py::arg("gain"), py::arg("exact"),
      "External torque [Nm, outward] from the momentum [Nm s] and what else drives it [Nm].");
  module.def("detect_collision", &detect_collision, py::arg("time"), py::arg("residual"),
             py::arg("velocity"), py::kw_only(), py::arg("speed_edges"), py::arg("negative"),
             py::arg("positive"), py::arg("release"), py::arg("hold"),
             "Whether each row is in contact by its external torque [Nm] and velocity [rad/s].");
}

}  // namespace flexspline::bindings
