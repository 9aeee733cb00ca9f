/// A fitted drive as a body that moves under the motor's torque.
///
///   J q̈ = y(t, v) − Σ rows(sample) · coefficients,   sum over all effects but inertia
///   y = Ñ τ_m − τ_load (or the motor's current)
///
/// The rows are those of the catalogue, with one change: the direction tanh(v / v_d) becomes its
/// limit v_d → 0. At v = 0 a row then has two one-sided limits, R(+0) and R(−0), and friction takes
/// any value between them: it holds the joint without creep as long as the driving torque lies
/// there. Evaluated as the rows themselves at ±`still`, with v_d = `sharp`.
///
/// The load that rows see is known load + J q̈ + gravity, so q̈ stands on both sides. With x = J q̈
/// and P the rows that read the load, x + P(L₀ + x) = D is solved by secants; it has one root where
/// a load's friction is smaller than the load.
#pragma once

#include <array>
#include <stdexcept>
#include <vector>

#include "flexspline/batch/by_name.hpp"
#include "flexspline/batch/forward/inputs.hpp"

namespace flexspline::batch::forward {

inline constexpr double sharp = 1e-300;  ///< rad/s, width of the direction
inline constexpr double still = 1e-100;  ///< rad/s, where rows have their limits at rest
inline constexpr std::size_t most_memories = 2;

using Memories = std::array<AnyState, most_memories>;

/// One effect of the drive.
struct Member {
  AnyEffect effect;
  std::vector<double> coefficients;
  std::size_t memory = 0;  ///< its place among the memories, where it remembers
  bool carries = false;    ///< part of the transmitted load
};

template <typename Test>
bool holds(const AnyEffect& any, Test test) {
  return std::visit(
      [&]<typename Effect>(const Effect&) { return test.template operator()<Effect>(); }, any);
}
inline bool reads_channel(const AnyEffect& any, Channel channel) {
  return holds(any, [channel]<typename Effect>() { return reads<Effect>(channel); });
}

/// row · coefficients of one effect.
template <typename Effect>
double torque_of(const Effect& effect, const Sample<double>& at, const double* coefficients,
                 [[maybe_unused]] AnyState& memory) noexcept {
  NoState none;
  double sum = 0;
  const auto add = [&](const auto& row, std::size_t terms) {
    for (std::size_t k = 0; k < terms; ++k) sum += row[k] * coefficients[k];
  };
  if constexpr (Remembers<Effect>) {
    add(effect.row(at, *std::get_if<place_of<Effect>>(&memory)), effect.terms.size());
  } else if constexpr (HarmonicEffect<Effect>) {
    add(row_of(effect, at, none), 2 * effect.count);
  } else {
    add(row_of(effect, at, none), effect.terms.size());
  }
  return sum;
}

inline double torque_of(const Member& member, const Sample<double>& at,
                        Memories& memories) noexcept {
  return std::visit(
      [&](const auto& effect) {
        return torque_of(effect, at, member.coefficients.data(), memories[member.memory]);
      },
      member.effect);
}

/// Where the last implicit solve ended, for the next one to start at.
struct Guess {
  double torque = 0;  ///< x = J q̈
  double slope = 1;   ///< of x + P(L₀ + x)
};

class Plant {
 public:
  /// `coefficients`: as many as the effects have terms. `motor_offset` [rad]: θ − Ñ q.
  /// std::invalid_argument without a positive inertia, or with too many effects that remember.
  Plant(std::vector<AnyEffect> effects, std::span<const double> coefficients,
        const Gear<double>& gear, double motor_offset)
      : gear_(gear), motor_offset_(Angle<double>::from_radians(motor_offset).phase) {
    for (AnyEffect& effect : effects) {
      const std::size_t terms = terms_of(effect);
      if (terms > coefficients.size()) throw std::invalid_argument("too few coefficients");
      add(std::move(effect), coefficients.first(terms));
      coefficients = coefficients.subspan(terms);
    }
    if (!coefficients.empty()) throw std::invalid_argument("too many coefficients");
    if (!(inertia_ > 0)) throw std::invalid_argument("the inertia is not above zero");
  }

  double inertia() const noexcept { return inertia_; }
  /// Whether something happens where the velocity passes zero: a jump, or a turn that is
  /// remembered.
  bool turns() const noexcept { return jumps_ || memories_ > 0; }
  bool remembers() const noexcept { return memories_ > 0; }
  const Memories& fresh() const noexcept { return fresh_; }

  /// The velocity at which rows are evaluated while the joint moves in `direction`: there a
  /// velocity beyond zero, within a step that is about to be cut, counts as none.
  double row_velocity(double velocity, int direction) const noexcept {
    if (!turns()) return velocity;
    const double along = direction * velocity;
    return direction * (along > still ? along : still);
  }

  /// q̈ [rad/s²] while the joint moves in `direction`. `late`: s since the start of the inputs.
  /// `memories` move on to this position.
  double acceleration(const Inputs& in, double late, double position, double velocity,
                      int direction, Memories& memories, Guess& guess) const noexcept {
    const Sample<double> at = sample(in, late, position, row_velocity(velocity, direction));
    return solved(at, drive(in, late, velocity), memories, guess) / inertia_;
  }

  /// By how much the drive surpasses, at rest, the friction that opposes motion in `direction`,
  /// Nm: the joint leaves that way where this has the sign of `direction`.
  double excess(const Inputs& in, double late, double position, int direction,
                const Memories& memories) const noexcept {
    Memories moved = memories;
    Sample<double> at = sample(in, late, position, direction * still);
    at.load = at.known_load;
    double rest = drive(in, late, 0);
    for (const Member& member : plain_) {
      const double torque = torque_of(member, at, moved);
      rest -= torque;
      if (member.carries) at.load += torque;
    }
    for (const Member& member : loaded_) rest -= torque_of(member, at, moved);
    return rest;
  }

  /// Moves the memories on to a position, where the joint moves in `direction`.
  void remember(const Inputs& in, double late, double position, int direction,
                Memories& memories) const noexcept {
    if (memories_ == 0) return;
    const Sample<double> at = sample(in, late, position, direction * still);
    for (const Member& member : plain_) {
      if (holds(member.effect, []<typename Effect>() { return Remembers<Effect>; })) {
        (void)torque_of(member, at, memories);
      }
    }
  }

  /// Whether no memory depends on its start any more.
  bool settled(const Memories& memories) const noexcept {
    bool all = true;
    for (const Member& member : plain_) {
      std::visit(
          [&]<typename Effect>(const Effect& effect) {
            if constexpr (Remembers<Effect>) {
              all &= effect.settled(*std::get_if<place_of<Effect>>(&memories[member.memory]));
            }
          },
          member.effect);
    }
    return all;
  }

  double drive_factor = 1;  ///< of the motor's column: Ñ for a torque at the shaft, 1 for a current
  double load_factor = 1;   ///< of the known load: 0 where the target leaves it in

 private:
  void add(AnyEffect effect, std::span<const double> coefficients) {
    Member member{std::move(effect), {coefficients.begin(), coefficients.end()}};
    AnyEffect& any = member.effect;
    if (holds(any, []<typename E>() { return std::is_same_v<E, Inertia<double>>; })) {
      inertia_ += coefficients[0];
      return;
    }
    for_each_shape(any, [this](const auto& shape, double& field) {
      if (shape.name != "direction_width") return;
      field = sharp;
      jumps_ = true;
    });
    member.carries = holds(any, []<typename E>() { return CarriesLoad<E>; });
    if (holds(any, []<typename E>() { return Remembers<E>; })) start_memory(member);
    motor_side_ |= reads_channel(any, Channel::motor_position);
    angles_ |= motor_side_ || reads_channel(any, Channel::output_position);
    (reads_channel(any, Channel::load) ? loaded_ : plain_).push_back(std::move(member));
  }

  void start_memory(Member& member) {
    if (memories_ == most_memories) throw std::invalid_argument("too many effects remember");
    if (reads_channel(member.effect, Channel::load)) {
      throw std::invalid_argument("an effect remembers the load");
    }
    member.memory = memories_++;
    std::visit([&]<typename E>(const E&) { fresh_[member.memory].emplace<place_of<E>>(); },
               member.effect);
  }

  double drive(const Inputs& in, double late, double velocity) const noexcept {
    const double motor = in.motor.at(late) - in.damping * velocity;
    return drive_factor * motor - load_factor * in.known_load.at(late);
  }

  Sample<double> sample(const Inputs& in, double late, double position,
                        double velocity) const noexcept {
    Sample<double> at;
    at.output_velocity = velocity;
    at.temperature = in.temperature.at(late);
    at.known_load = in.known_load.at(late);
    at.time = in.time + late;
    if (!angles_) return at;
    at.output_position = Angle<double>::from_radians(position);
    if (!motor_side_) return at;
    const Phase<double> q = at.output_position.phase;
    const Phase<double> theta = gear_.motor_phase(at.output_position) + motor_offset_;
    at.motor_position = {0, theta};
    at.wave_generator_on_flexspline = gear_.against_flexspline(q, theta);
    at.wave_generator_on_circular_spline = gear_.against_circular_spline(q, theta);
    return at;
  }

  /// x = J q̈.
  double solved(Sample<double> at, double drive, Memories& memories, Guess& guess) const noexcept {
    double carried = at.known_load;
    for (const Member& member : plain_) {
      const double torque = torque_of(member, at, memories);
      drive -= torque;
      if (member.carries) carried += torque;
    }
    if (loaded_.empty()) return drive;
    const auto missing = [&](double x) {
      at.load = carried + x;
      double sum = x - drive;
      for (const Member& member : loaded_) sum += torque_of(member, at, memories);
      return sum;
    };
    return root(missing, math::absolute(drive) + math::absolute(carried), guess);
  }

  /// Where an increasing function that is made of straight lines, or nearly, passes zero.
  template <typename Function>
  static double root(const Function& function, double scale, Guess& guess) noexcept {
    const double enough = 1e-14 * scale;
    double x = guess.torque;
    double value = function(x);
    for (int round = 0; round < 20 && !(math::absolute(value) <= enough); ++round) {
      const double next = x - value / guess.slope;
      if (next == x) break;
      const double found = function(next);
      const double slope = (found - value) / (next - x);
      if (slope > 0 && math::absolute(next - x) > 1e-7 * scale) guess.slope = slope;
      x = next;
      value = found;
    }
    guess.torque = x;
    return x;
  }

  std::vector<Member> plain_, loaded_;  ///< those that do not read the load, and those that do
  Gear<double> gear_;
  Phase<double> motor_offset_;
  Memories fresh_{};
  double inertia_ = 0;
  std::size_t memories_ = 0;
  bool jumps_ = false;
  bool angles_ = false;
  bool motor_side_ = false;
};

}  // namespace flexspline::batch::forward
