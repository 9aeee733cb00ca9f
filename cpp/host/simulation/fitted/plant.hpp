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

#include <span>
#include <stdexcept>

#include "host/simulation/fitted/inputs.hpp"
#include "host/simulation/fitted/steady.hpp"

namespace flexspline::batch::forward {

class Plant {
 public:
  /// `coefficients`: as many as the effects have terms. `motor_offset` [rad]: θ − Ñ q.
  /// std::invalid_argument without a positive inertia, with too many effects that remember, and
  /// with friction that exceeds its load.
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
    inverse_inertia_ = 1 / inertia_;
    for (Steady& s : steady_) {
      if (!(s.above > -1 && s.below < 1)) throw std::invalid_argument("friction exceeds its load");
      s.prepare();
    }
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
                      int direction, Memories& memories) const noexcept {
    const Sample<double> at = sample(in, late, position, row_velocity(velocity, direction));
    const auto [taken, carried] = plain(at, memories);
    const double load = at.known_load + carried;
    const double base = simulation::net_torque(drive(in, late, velocity), taken, 0);
    return (steady_[direction > 0].load_of(base + load) - load) * inverse_inertia_;
  }

  /// By how much the drive surpasses, at rest, the friction that opposes motion in `direction`,
  /// Nm: the joint leaves that way where this has the sign of `direction`.
  double excess(const Inputs& in, double late, double position, int direction,
                const Memories& memories) const noexcept {
    Memories moved = memories;
    const Sample<double> at = sample(in, late, position, direction * still);
    const auto [taken, carried] = plain(at, moved);
    const double friction = steady_[direction > 0].at(at.known_load + carried);
    return simulation::net_torque(drive(in, late, 0), taken, friction);
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
    if (const auto lines = steady(member)) {
      for (const std::size_t way : {0U, 1U}) steady_[way] += (*lines)[way];
      return;
    }
    if (reads_channel(any, Channel::load) && !blind_to_load(member)) {
      throw std::invalid_argument("an effect depends on the load in a way that cannot be solved");
    }
    plain_.push_back(std::move(member));
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
    for_each_place<NumberPlaces::size()>([&](std::size_t k) {
      if (!is_made(numbers<double>[k].channel)) at.*numbers<double>[k].at = in.number[k].at(late);
    });
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

  /// What effects take that are no lines of the load, and the part of it that they carry.
  struct Taken {
    double torque = 0;
    double carried = 0;
  };
  Taken plain(const Sample<double>& at, Memories& memories) const noexcept {
    Taken sum;
    for (const Member& member : plain_) {
      const double torque = torque_of(member, at, memories);
      sum.torque += torque;
      if (member.carries) sum.carried += torque;
    }
    return sum;
  }

  std::vector<Member> plain_;  ///< effects whose rows are evaluated at each step
  BothWays steady_{};          ///< the sum of the others
  Gear<double> gear_;
  Phase<double> motor_offset_;
  Memories fresh_{};
  double inertia_ = 0;
  double inverse_inertia_ = 0;
  std::size_t memories_ = 0;
  bool jumps_ = false;
  bool angles_ = false;
  bool motor_side_ = false;
};

}  // namespace flexspline::batch::forward
