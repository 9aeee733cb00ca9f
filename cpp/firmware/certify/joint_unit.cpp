// The exported chain of estimators: raw readings to external torque and contact.
#include "joint.hpp"
#include "unit.hpp"

namespace {

using Joint = joint::Joint<unit::Scalar>;

constinit flexspline::Reading<unit::Scalar> in{};
constinit Joint::State state{};
constinit Joint::Chain::Output out{};

std::optional<flexspline::Angle<unit::Scalar>> angle(const certify::Row<unit::Scalar>& row,
                                                     unsigned which) noexcept {
  const std::uint32_t mark = certify::has_output_position << which;
  if ((row.marks & mark) == 0) return std::nullopt;
  return flexspline::Angle<unit::Scalar>{row.turns[which], {row.fractions[which]}};
}

template <typename J>
void give_adapted(const J& made, certify::Result<unit::Scalar>& result) noexcept {
  if constexpr (J::adapts) {
    const auto now = made.adapted(state);
    for (std::size_t k = 0; k < now.size(); ++k) result.values[8 + k] = now[k];
  }
}

}  // namespace

void unit::take(const certify::Row<Scalar>& row) noexcept {
  if ((row.marks & certify::fresh) != 0) Joint::restart(state);
  in.output_position = angle(row, 0);
  in.motor_position = angle(row, 1);
  for (unsigned k = 0; k < row.numbers.size(); ++k) {
    in.*flexspline::numbers<Scalar>[k].read = row.numbers[k];
  }
  for (unsigned k = 0; k < row.instruments.size(); ++k) {
    in.*flexspline::instruments<Scalar>[k].read = row.instruments[k];
  }
}

void unit::give(certify::Result<Scalar>& result) noexcept {
  result.values = {out.temperature,       out.sensor_torque,       out.external_sensor,
                   out.external_observer, out.external_compliance, out.external_compliant_observer,
                   out.external_merged,   out.merge_weight};
  give_adapted(joint::joint<Scalar>, result);
  result.contact = out.contact ? 1 : 0;
  result.flags = static_cast<std::uint8_t>(out.flags);
  result.faults = static_cast<std::uint8_t>(out.faults);
  result.missed = static_cast<std::uint16_t>(out.missed);
}

// Flattened, so that the constants of joint.hpp fold into the code: stages that are not there, and
// choices that are made, cost nothing.
extern "C" [[gnu::flatten]] flexspline::Status flexspline_step() noexcept {
  return joint::joint<unit::Scalar>.step(state, in, out);
}
