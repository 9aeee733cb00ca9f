#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "bindings.hpp"
#include "host/simulation/rig/simulate.hpp"

namespace flexspline::bindings {

namespace sim = batch::simulation;

namespace {

/// Sets a field from a dict where it is there.
template <typename T>
void read(const py::dict& from, const char* name, T& field) {
  if (from.contains(name)) field = from[name].cast<T>();
}

sim::Friction friction_of(const py::dict& from) {
  sim::Friction f;
  read(from, "coulomb_forward", f.coulomb_forward);
  read(from, "coulomb_backward", f.coulomb_backward);
  read(from, "load_forward", f.load_forward);
  read(from, "load_backward", f.load_backward);
  read(from, "stribeck", f.stribeck);
  read(from, "stribeck_velocity", f.stribeck_velocity);
  read(from, "viscous", f.viscous);
  read(from, "quadratic", f.quadratic);
  read(from, "cubic", f.cubic);
  read(from, "coulomb_fade", f.coulomb_fade);
  read(from, "viscous_fade", f.viscous_fade);
  read(from, "reference_temperature", f.reference_temperature);
  return f;
}

OutputSpline spline_of(const py::dict& from) {
  std::string name;
  read(from, "output_spline", name);
  return name == "circular" ? OutputSpline::circular
         : name == "flex"   ? OutputSpline::flex
                            : OutputSpline::unknown;
}

/// (order, amplitude, phase in rad, number of the pair of parts)
using WaveTuple = std::tuple<std::uint32_t, double, double, int>;
sim::Waves waves_of(const py::dict& from, const char* name) {
  std::vector<WaveTuple> given;
  read(from, name, given);
  sim::Waves waves;
  const OutputSpline spline = spline_of(from);
  for (const auto& [order, amplitude, phase, pair] : given) {
    waves.push_back({amplitude, order, Angle<double>::from_radians(phase).phase,
                     sim::turning(static_cast<Pair>(pair), spline)});
  }
  return waves;
}

void read_spring(const py::dict& from, sim::Joint& joint) {
  read(from, "mesh_stiffness", joint.spring.mesh_stiffness);
  read(from, "mesh_shape", joint.spring.mesh_shape);
  read(from, "wave_generator_stiffness", joint.spring.wave_generator_stiffness);
  read(from, "wave_generator_shape", joint.spring.wave_generator_shape);
}

void read_elements(const py::dict& from, sim::Joint& joint) {
  std::vector<std::tuple<double, double, double, double>> given;
  read(from, "elements", given);
  if (given.size() > sim::most_elements) throw std::invalid_argument("too many elements");
  for (const auto& [stiffness, level, motor, output] : given) {
    joint.elements[joint.element_count++] = {stiffness, level, {motor, output}};
  }
}

void read_surroundings(const py::dict& from, sim::Joint& joint) {
  read(from, "obstacle_angle", joint.obstacle.angle);
  read(from, "obstacle_direction", joint.obstacle.direction);
  read(from, "obstacle_stiffness", joint.obstacle.stiffness);
  read(from, "obstacle_dissipation", joint.obstacle.dissipation);
  read(from, "motor_capacity", joint.thermal.motor_capacity);
  read(from, "body_capacity", joint.thermal.body_capacity);
  read(from, "motor_to_body", joint.thermal.motor_to_body);
  read(from, "motor_to_room", joint.thermal.motor_to_room);
  read(from, "body_to_room", joint.thermal.body_to_room);
  read(from, "copper_loss", joint.thermal.copper_loss);
}

sim::Joint joint_of(const py::dict& from) {
  sim::Joint joint;
  read(from, "ratio", joint.ratio);
  read(from, "motor_inertia", joint.motor_inertia);
  read(from, "output_inertia", joint.output_inertia);
  read(from, "link_inertia", joint.link_inertia);
  read(from, "gravity", joint.gravity);
  read(from, "gravity_angle", joint.gravity_angle);
  read(from, "damping", joint.damping);
  read(from, "brake", joint.brake);
  joint.friction = {friction_of(from["motor_friction"].cast<py::dict>()),
                    friction_of(from["output_friction"].cast<py::dict>())};
  joint.kinematic_error = waves_of(from, "kinematic_error");
  joint.current_ripple = waves_of(from, "current_ripple");
  joint.cogging = waves_of(from, "cogging");
  joint.output_ripple = waves_of(from, "output_ripple");
  joint.friction_ripple = waves_of(from, "friction_ripple");
  read_spring(from, joint);
  read_elements(from, joint);
  read_surroundings(from, joint);
  return prepared(joint);
}

sim::Options options_of(const py::dict& from) {
  sim::Options o;
  read(from, "longest_step", o.longest_step);
  read(from, "order", o.order);
  read(from, "accuracy", o.accuracy);
  read(from, "shortest_leap", o.shortest_series_step);
  read(from, "coarsest", o.coarsest);
  read(from, "servo_period", o.servo.period);
  read(from, "position_gain", o.servo.position_gain);
  read(from, "velocity_gain", o.servo.velocity_gain);
  read(from, "integral_gain", o.servo.integral_gain);
  read(from, "torque_limit", o.servo.limit);
  read(from, "encoder_step", o.servo.encoder_step);
  read(from, "reads_output", o.servo.reads_output);
  read(from, "servo_delay", o.servo.delay);
  if (o.servo.delay > sim::longest_delay) throw std::invalid_argument("servo_delay is too long");
  read(from, "stop_time", o.stop.time);
  read(from, "stop_threshold", o.stop.threshold);
  read(from, "stop_delay", o.stop.delay);
  int reaction = 0;
  read(from, "stop_reaction", reaction);
  o.stop.reaction = static_cast<sim::Reaction>(reaction);
  return o;
}

/// Borrowed input columns.
struct Columns {
  sim::Signals signals;
  std::vector<Array> arrays;

  const double* take(const py::dict& from, const char* name) {
    if (!from.contains(name)) return nullptr;
    arrays.push_back(from[name].cast<Array>());
    if (static_cast<std::size_t>(arrays.back().size()) != signals.size) {
      throw std::invalid_argument(std::string(name) + " has another length than time");
    }
    return arrays.back().data();
  }
};

Columns columns_of(const Array& time, const py::dict& inputs, bool hold) {
  Columns c;
  c.signals.time = time.data();
  c.signals.size = static_cast<std::size_t>(time.size());
  c.signals.hold = hold;
  c.signals.motor_torque = c.take(inputs, "motor_torque");
  c.signals.load_torque = c.take(inputs, "load_torque");
  c.signals.room_temperature = c.take(inputs, "room_temperature");
  c.signals.position_command = c.take(inputs, "position_command");
  c.signals.velocity_command = c.take(inputs, "velocity_command");
  return c;
}

/// Where it starts: numbers of the caller, or the memory of an earlier run.
sim::SimulationState simulation_state_of(const sim::Joint& joint, const py::dict& start) {
  sim::SimulationState c;
  const auto memory = start["memory"].cast<std::string>();
  if (!memory.empty()) {
    if (memory.size() != sizeof c) throw std::invalid_argument("memory of another build");
    std::memcpy(&c, memory.data(), sizeof c);
    return c;
  }
  sim::Motion& m = c.motion;
  read(start, "output_position", m.position[sim::output]);
  read(start, "output_velocity", m.velocity[sim::output]);
  double through = 0;
  read(start, "transmitted_torque", through);
  m.position[sim::motor] = sim::resting_motor_angle(joint, m.position[sim::output], through);
  read(start, "motor_position", m.position[sim::motor]);
  if (!joint.rigid) {
    m.velocity[sim::motor] = joint.ratio * m.velocity[sim::output];
    read(start, "motor_velocity", m.velocity[sim::motor]);
  }
  read(start, "motor_temperature", m.temperature[sim::motor]);
  read(start, "body_temperature", m.temperature[sim::output]);
  return c;
}

py::dict end_of(const sim::Joint& joint, const sim::SimulationState& c) {
  static_assert(std::is_trivially_copyable_v<sim::SimulationState>);
  const sim::Motion& m = c.motion;
  py::dict end;
  const double q = m.position[sim::output];
  end["output_position"] = q;
  end["output_velocity"] = m.velocity[sim::output];
  end["motor_position"] = joint.rigid ? sim::rigid_motor_angle(joint, q) : m.position[sim::motor];
  end["motor_velocity"] =
      joint.rigid ? joint.ratio * m.velocity[sim::output] : m.velocity[sim::motor];
  end["motor_temperature"] = m.temperature[sim::motor];
  end["body_temperature"] = m.temperature[sim::output];
  end["memory"] = py::bytes(reinterpret_cast<const char*>(&c), sizeof c);
  return end;
}

py::dict simulate(const sim::Joint& given, const Array& time, const py::dict& inputs, bool hold,
                  const py::dict& option_fields, const py::dict& start,
                  const std::vector<std::string>& channels) {
  sim::Joint joint = given;
  const sim::Options options = options_of(option_fields);
  const Columns columns = columns_of(time, inputs, hold);
  if (columns.signals.size < 2) throw std::invalid_argument("time needs two rows");
  sim::SimulationState state = simulation_state_of(joint, start);
  const bool fresh = start["memory"].cast<std::string>().empty();
  py::dict result;
  sim::Record record;
  for (std::size_t k = 0; k < sim::column_names.size(); ++k) {
    const std::string name(sim::column_names[k]);
    if (std::find(channels.begin(), channels.end(), name) == channels.end()) continue;
    py::array_t<double> array(time.size());
    record.column[k] = array.mutable_data();
    result[name.c_str()] = array;
  }
  joint.accounts = sim::needs_work(joint, record);
  sim::Outcome outcome;
  {
    const py::gil_scoped_release release;
    outcome = sim::simulate(joint, columns.signals, options, fresh, state, record);
  }
  py::dict all;
  all["columns"] = result;
  all["fault"] = static_cast<int>(outcome.fault);
  all["row"] = outcome.row;
  all["largest_phase"] = outcome.largest_phase;
  all["longest_leap"] = outcome.longest_series_step;
  all["end"] = end_of(joint, state);
  return all;
}

}  // namespace

void bind_simulation(py::module_& module) {
  std::vector<std::string> names(sim::column_names.begin(), sim::column_names.end());
  module.attr("simulation_columns") = names;
  module.attr("simulation_elements") = sim::most_elements;
  py::class_<sim::Joint>(module, "SimulatedJoint", "The parameters of a joint, ready to simulate.")
      .def(py::init(&joint_of), py::arg("fields"))
      .def_property_readonly(
          "eventless", [](const sim::Joint& joint) { return joint.eventless; },
          "True where nothing can stick, slip or touch.")
      .def_property_readonly(
          "expandable", [](const sim::Joint& joint) { return sim::expandable(joint); },
          "True where the motion is a power series between kinks, and energy is lost.");
  module.def("simulate", &simulate, py::arg("joint"), py::arg("time"), py::arg("inputs"),
             py::arg("hold"), py::arg("options"), py::arg("start"), py::arg("channels"),
             "Drives a joint through time: dict of columns, fault, row, largest_phase, end.");
  module.def(
      "simulation_rates",
      [](const sim::Joint& joint, double torque) {
        const double stiffness = sim::spring_at(joint.spring, torque / joint.ratio).stiffness;
        const sim::Fastest f = sim::fastest(joint, stiffness);
        return py::make_tuple(f.frequency, f.decay);
      },
      py::arg("joint"), py::arg("torque"),
      "Fastest eigenfrequency and decay [1/s] where the gear transmits `torque` [Nm].");
  module.def(
      "simulation_windup",
      [](const sim::Joint& joint, const Array& torque) {
        py::array_t<double> out(torque.size());
        for (py::ssize_t i = 0; i < torque.size(); ++i) {
          out.mutable_data()[i] =
              sim::spring_at(joint.spring, torque.data()[i] / joint.ratio).windup;
        }
        return out;
      },
      py::arg("joint"), py::arg("torque"),
      "Wind-up of the gear [rad, motor side] at transmitted torques [Nm, output].");
  module.def(
      "simulation_torque",
      [](const sim::Joint& joint, const Array& windup) {
        py::array_t<double> out(windup.size());
        sim::SpringPoint near = sim::spring_at(joint.spring, 0);
        for (py::ssize_t i = 0; i < windup.size(); ++i) {
          const double torque = sim::torque_of(joint.spring, windup.data()[i], near);
          out.mutable_data()[i] = joint.ratio * torque;
        }
        return out;
      },
      py::arg("joint"), py::arg("windup"),
      "Transmitted torque [Nm, output] at wind-ups [rad, motor side]; infinite past the pole.");
}

}  // namespace flexspline::bindings
