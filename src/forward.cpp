#include <map>
#include <stdexcept>

#include "bindings.hpp"
#include "host/simulation/fitted/drive.hpp"

namespace flexspline::bindings {

namespace fwd = batch::forward;

namespace {

fwd::Plant plant_from(const batch::Design& design, const Array& coefficients, double motor_offset,
                      double drive_factor, double load_factor) {
  fwd::Plant plant(design.effects(),
                   {coefficients.data(), static_cast<std::size_t>(coefficients.size())},
                   design.gear(), motor_offset);
  plant.drive_factor = drive_factor;
  plant.load_factor = load_factor;
  return plant;
}

std::optional<fwd::PositionServo> servo_from(const std::map<std::string, double>& given) {
  if (given.empty()) return std::nullopt;
  fwd::PositionServo servo;
  const std::map<std::string, double fwd::PositionServo::*> fields{
      {"position_gain", &fwd::PositionServo::position_gain},
      {"velocity_gain", &fwd::PositionServo::velocity_gain},
      {"integral_gain", &fwd::PositionServo::integral_gain},
      {"limit", &fwd::PositionServo::limit},
      {"torque", &fwd::PositionServo::torque},
      {"back_emf", &fwd::PositionServo::back_emf},
      {"encoder_step", &fwd::PositionServo::encoder_step},
  };
  for (const auto& [name, value] : given) {
    const auto field = fields.find(name);
    if (field == fields.end()) throw std::invalid_argument("a servo has no '" + name + "'");
    servo.*(field->second) = value;
  }
  return servo;
}

/// Borrowed inputs, held together with the arrays that they point into.
struct Given {
  fwd::Signals signals;
  std::vector<Array> arrays;
};

Given given_from(const Array& time, const py::dict& columns, bool hold) {
  Given given;
  fwd::Signals& s = given.signals;
  s.size = static_cast<std::size_t>(time.size());
  s.time = time.data();
  s.hold = hold;
  const auto take = [&](const char* name, const double*& field) {
    if (!columns.contains(name)) return;
    given.arrays.push_back(columns[name].cast<Array>());
    field = column_or_null(given.arrays.back(), s.size, name);
  };
  take("motor", s.motor);
  take("known_load", s.known_load);
  take("command", s.command);
  take("enabled", s.enabled);
  take("supply", s.supply);
  for (std::size_t k = 0; k < s.number.size(); ++k) {
    const Number<double>& each = numbers<double>[k];
    if (!fwd::is_made(each.channel)) take(std::string(each.name()).c_str(), s.number[k]);
  }
  return given;
}

py::tuple drive(const fwd::Plant& plant, const Array& time, const py::dict& columns,
                const std::map<std::string, double>& servo_fields, double position, double velocity,
                std::size_t steps, bool hold, const std::vector<std::string>& channels) {
  const Given given = given_from(time, columns, hold);
  const auto servo = servo_from(servo_fields);
  if (given.signals.size < 2) throw std::invalid_argument("time needs two rows");
  if (steps < 1) throw std::invalid_argument("steps is 1 or more");
  if (servo && given.signals.command == nullptr) throw std::invalid_argument("no command");
  py::dict made;
  fwd::Record record;
  const std::array<std::pair<const char*, double**>, 5> known{
      {{"position", &record.position},
       {"velocity", &record.velocity},
       {"acceleration", &record.acceleration},
       {"motor", &record.motor},
       {"stuck", &record.stuck}}};
  for (const std::string& channel : channels) {
    const auto* field = std::find_if(known.begin(), known.end(),
                                     [&](const auto& entry) { return channel == entry.first; });
    if (field == known.end()) throw std::invalid_argument("there is no channel '" + channel + "'");
    py::array_t<double> array(time.size());
    *field->second = array.mutable_data();
    made[field->first] = array;
  }
  std::size_t valid = 0;
  {
    const py::gil_scoped_release release;
    valid = fwd::drive(plant, given.signals, servo, position, velocity, steps, record);
  }
  return py::make_tuple(made, valid);
}

}  // namespace

void bind_forward(py::module_& module) {
  py::list given;
  for (const Number<double>& each : numbers<double>) {
    if (!fwd::is_made(each.channel)) given.append(std::string(each.name()));
  }
  module.attr("given_numbers") = py::tuple(given);
  py::class_<fwd::Plant>(module, "Plant", "A fitted drive as a body that moves.")
      .def(py::init(&plant_from), py::arg("design"), py::arg("coefficients"),
           py::arg("motor_offset"), py::arg("drive_factor"), py::arg("load_factor"))
      .def_property_readonly("inertia", &fwd::Plant::inertia, "kg m², or A s²/rad of a current.")
      .def("drive", &drive, py::arg("time"), py::arg("columns"), py::arg("servo"),
           py::arg("position"), py::arg("velocity"), py::arg("steps"), py::arg("hold"),
           py::arg("channels"),
           "Drives through the inputs of a log: what is asked for, and how many rows are valid.");
}

}  // namespace flexspline::bindings
