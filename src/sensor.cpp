#include "bindings.hpp"
#include "host/replay_ripple.hpp"
#include "host/replay_sensor.hpp"

namespace flexspline::bindings {

namespace {

using batch::AnyBridge;
using batch::most_gauges;
using Waves = std::vector<WaveStrain<double>>;

std::size_t length(const Array& array) { return static_cast<std::size_t>(array.size()); }

/// One value for each gauge; `name` is what an error calls it.
const double* of_gauges(const Array& array, std::size_t count, const char* name) {
  if (length(array) != count) throw std::invalid_argument(std::string(name) + ": one per gauge");
  return array.data();
}

AnyBridge bridge_of(const Array& sign, const Array& arm, double gauge_factor, double supply) {
  AnyBridge bridge;
  bridge.count = length(sign);
  if (bridge.count == 0 || bridge.count > most_gauges) {
    throw std::invalid_argument("a bridge has 1 to 16 gauges");
  }
  const double* signs = sign.data();
  const double* arms = of_gauges(arm, bridge.count, "arm");
  for (std::size_t i = 0; i < bridge.count; ++i) {
    bridge.gauges[i].sign = signs[i];
    bridge.gauges[i].arm = arms[i];
  }
  bridge.gauge_factor = gauge_factor;
  bridge.supply = supply;
  return bridge;
}

/// Rows of order, bending cosine and sine, stretching cosine and sine.
Waves waves_of(const Array& rows) {
  if (rows.ndim() != 2 || rows.shape(1) != 5) throw std::invalid_argument("waves: shape (O, 5)");
  Waves waves;
  for (py::ssize_t k = 0; k < rows.shape(0); ++k) {
    const double* w = rows.data(k, 0);
    waves.push_back({static_cast<std::uint32_t>(w[0]), {w[1], w[2]}, {w[3], w[4]}});
  }
  return waves;
}

void place(AnyBridge& bridge, const double* position, const double* sensitivity) {
  for (std::size_t i = 0; i < bridge.count; ++i) {
    bridge.gauges[i].angle = Angle<double>::from_radians(position[i]).phase;
    bridge.gauges[i].sensitivity = sensitivity[i];
  }
}

py::ssize_t rows_of(const Array& array, const AnyBridge& bridge, const char* name) {
  const auto count = static_cast<py::ssize_t>(bridge.count);
  if (array.ndim() != 2 || array.shape(1) != count) {
    throw std::invalid_argument(std::string(name) + ": one column per gauge");
  }
  return array.shape(0);
}

py::tuple bridge_signal(const Array& angle, const Array& torque_strain, const Array& warmer,
                        const Array& position, const Array& sensitivity, const Array& sign,
                        const Array& arm, const Array& thermal_linear,
                        const Array& thermal_quadratic, const Array& waves, double gauge_factor,
                        double supply) {
  AnyBridge bridge = bridge_of(sign, arm, gauge_factor, supply);
  const std::size_t count = bridge.count;
  place(bridge, of_gauges(position, count, "position"),
        of_gauges(sensitivity, count, "sensitivity"));
  const double* linear = of_gauges(thermal_linear, count, "thermal_linear");
  const double* quadratic = of_gauges(thermal_quadratic, count, "thermal_quadratic");
  for (std::size_t i = 0; i < count; ++i) {
    bridge.gauges[i].thermal_linear = linear[i];
    bridge.gauges[i].thermal_quadratic = quadratic[i];
  }
  const Waves known = waves_of(waves);
  const py::ssize_t size = angle.size();
  column_or_null(torque_strain, length(angle), "torque_strain");
  if (rows_of(warmer, bridge, "warmer") != size) throw std::invalid_argument("warmer: (N, n)");
  Array strain({size, static_cast<py::ssize_t>(count)});
  Array voltage(size);
  batch::replay_bridge(bridge, known.data(), known.size(), angle.data(), torque_strain.data(),
                       warmer.data(), length(angle), strain.mutable_data(), voltage.mutable_data());
  return py::make_tuple(strain, voltage);
}

py::tuple bridge_ripple(const Array& position, const Array& sensitivity, const Array& sign,
                        const Array& arm, const Array& waves) {
  AnyBridge bridge = bridge_of(sign, arm, 1.0, 1.0);
  const Waves known = waves_of(waves);
  const py::ssize_t draws = rows_of(position, bridge, "position");
  if (rows_of(sensitivity, bridge, "sensitivity") != draws) {
    throw std::invalid_argument("sensitivity: the shape of position");
  }
  const auto orders = static_cast<py::ssize_t>(known.size());
  Array cosine({draws, orders});
  Array sine({draws, orders});
  Array gain(draws);
  for (py::ssize_t row = 0; row < draws; ++row) {
    place(bridge, position.data(row, 0), sensitivity.data(row, 0));
    gain.mutable_data()[row] = bridge.torque_gain();
    for (py::ssize_t k = 0; k < orders; ++k) {
      const auto left = bridge.ripple(known[static_cast<std::size_t>(k)]);
      *cosine.mutable_data(row, k) = left.cosine;
      *sine.mutable_data(row, k) = left.sine;
    }
  }
  return py::make_tuple(cosine, sine, gain);
}

Array gauge_sensitivity(const Array& factor_error, const Array& tilt, double poisson) {
  column_or_null(tilt, length(factor_error), "tilt");
  Array result(
      std::vector<py::ssize_t>(factor_error.shape(), factor_error.shape() + factor_error.ndim()));
  for (py::ssize_t i = 0; i < factor_error.size(); ++i) {
    const auto turned = Angle<double>::from_radians(tilt.data()[i]).phase;
    result.mutable_data()[i] = sensitivity_of(factor_error.data()[i], turned, poisson);
  }
  return result;
}

py::tuple condition_signal(const Array& time, const Array& voltage, double gain, double offset,
                           double time_constant, double reference, int bits) {
  const Conditioning<double>::Config config{gain, offset, time_constant, reference, bits};
  column_or_null(time, length(voltage), "time");
  const py::ssize_t size = voltage.size();
  Array read(size);
  py::array_t<std::uint8_t> flags(size);
  batch::replay_conditioning(time.data(), voltage.data(), length(voltage), config,
                             read.mutable_data(), flags.mutable_data());
  return py::make_tuple(read, flags);
}

py::tuple noise_variances(double resistance, double amplifier_noise, double gain,
                          double time_constant, double capacitance, double reference, int bits,
                          double temperature) {
  const auto variances =
      Conditioning<double>::noise_variances({gain, 0.0, time_constant, reference, bits}, resistance,
                                            amplifier_noise, capacitance, temperature);
  return py::make_tuple(variances.bridge, variances.amplifier, variances.low_pass,
                        variances.rounding);
}

template <std::size_t K>
std::array<std::uint32_t, K> orders_of(const std::vector<std::uint32_t>& orders) {
  if (orders.empty() || orders.size() > K) throw std::invalid_argument("one to eight orders");
  std::array<std::uint32_t, K> found{};
  for (std::size_t k = 0; k < orders.size(); ++k) found[k] = orders[k];
  return found;
}

Array ripple_oscillator(const Array& time, const Array& angle, const Array& reading,
                        const std::vector<std::uint32_t>& orders, double noise, double level_rate,
                        double ripple_rate, double amplitude) {
  const auto known = orders_of<batch::most_ripple_orders>(orders);
  column_or_null(time, length(reading), "time");
  column_or_null(angle, length(reading), "angle");
  Array torque(reading.size());
  batch::replay_ripple_oscillator(time.data(), angle.data(), reading.data(), length(reading),
                                  {known, orders.size(), noise, level_rate, ripple_rate, amplitude},
                                  torque.mutable_data());
  return torque;
}

Array order_tracker(const Array& angle, const Array& reading,
                    const std::vector<std::uint32_t>& orders, std::size_t points) {
  const auto known = orders_of<batch::most_ripple_orders>(orders);
  if (points > batch::most_grid_angles) throw std::invalid_argument("points: at most 256");
  column_or_null(angle, length(reading), "angle");
  Array torque(reading.size());
  batch::replay_order_tracker(angle.data(), reading.data(), length(reading),
                              batch::Tracker::config_of(known, orders.size(), points),
                              torque.mutable_data());
  return torque;
}

void bind_bridge(py::module_& module) {
  using py::arg;
  module.def("bridge_signal", &bridge_signal, arg("angle"), arg("torque_strain"), arg("warmer"),
             arg("position"), arg("sensitivity"), arg("sign"), arg("arm"), arg("thermal_linear"),
             arg("thermal_quadratic"), arg("waves"), arg("gauge_factor"), arg("supply"),
             "Strain of each gauge, (N, n), and output of the bridge in V, (N,).");
  module.def("bridge_ripple", &bridge_ripple, arg("position"), arg("sensitivity"), arg("sign"),
             arg("arm"), arg("waves"),
             "Ripple at the output of each placement as strain: cosine, sine, (D, O); torque "
             "gain, (D,).");
  module.def("gauge_sensitivity", &gauge_sensitivity, arg("factor_error"), arg("tilt"),
             arg("poisson"), "Sensitivity of gauges with a factor error and a tilt [rad].");
}

void bind_electronics(py::module_& module) {
  using py::arg;
  module.def("condition_signal", &condition_signal, arg("time"), arg("voltage"), arg("gain"),
             arg("offset"), arg("time_constant"), arg("reference"), arg("bits"),
             "What the converter reads of a bridge [V], and flags: 2 at the end of its range.");
  module.def("noise_variances", &noise_variances, arg("resistance"), arg("amplifier_noise"),
             arg("gain"), arg("time_constant"), arg("capacitance"), arg("reference"), arg("bits"),
             arg("temperature"),
             "Variances at the converter [V²]: bridge, amplifier, low pass, rounding.");
}

void bind_ripple_filters(py::module_& module) {
  using py::arg;
  module.def("replay_ripple_oscillator", &ripple_oscillator, arg("time"), arg("angle"),
             arg("reading"), arg("orders"), arg("noise"), arg("level_rate"), arg("ripple_rate"),
             arg("amplitude"),
             "Torque of each row, the ripple taken out by the core's Kalman oscillator.");
  module.def("replay_order_tracker", &order_tracker, arg("angle"), arg("reading"), arg("orders"),
             arg("points"), "Torque of each row, the orders taken out over the resampled angle.");
}

}  // namespace

void bind_sensor(py::module_& module) {
  bind_bridge(module);
  bind_electronics(module);
  bind_ripple_filters(module);
}

}  // namespace flexspline::bindings
