#include <doctest/doctest.h>

#include <limits>
#include <set>
#include <string_view>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

/// The effect's row and its negative at the opposite velocity are the same numbers.
template <typename S, typename Effect>
void check_odd_in_velocity(const Effect& effect) {
  std::mt19937_64 random(20);
  for (int i = 0; i < 1000; ++i) {
    auto at = i % 2 == 0 ? usual_sample<S>(random) : any_sample<S>(random);
    const auto forward = effect.row(at);
    at.output_velocity = -at.output_velocity;
    const auto backward = effect.row(at);
    for (std::size_t k = 0; k < forward.size(); ++k) CHECK(backward[k] == -forward[k]);
  }
}

template <typename S, typename Effect>
consteval auto row_by_the_compiler() {
  Effect effect;
  Sample<S> at;
  StateOf<Effect> state;
  return row_of<S>(effect, at, state);
}

/// Whether an effect reads a channel: of several that may drive it, only the one in use.
template <typename Effect>
bool reads_now(const Effect& effect, Channel channel) {
  if constexpr (requires { effect.paths; }) {
    for (std::size_t k = 0; k < effect.paths.size(); ++k) {
      if (effect.paths[k].channel == channel) return static_cast<std::size_t>(effect.path) == k;
    }
  }
  return reads<Effect>(channel);
}

/// Calls use(effect) for each of its paths.
template <typename Effect, typename Use>
void for_each_path(Effect effect, Use use) {
  if constexpr (requires { effect.paths; }) {
    for (std::size_t k = 0; k < effect.paths.size(); ++k) {
      effect.path = static_cast<decltype(effect.path)>(k);
      use(std::as_const(effect));
    }
  } else {
    use(std::as_const(effect));
  }
}

template <typename S, typename Effect>
auto row_at_velocity(const Effect& effect, S velocity) {
  Sample<S> at;
  at.output_velocity = velocity;
  at.load = S(40);
  return effect.row(at);
}

/// Replaces what `channel` holds by something else.
template <typename S>
void disturb(Sample<S>& at, Channel channel, std::mt19937_64& random) {
  const Sample<S> other = usual_sample<S>(random);
  switch (channel) {
    case Channel::output_position:
      at.output_position = other.output_position;
      break;
    case Channel::output_velocity:
      at.output_velocity = other.output_velocity;
      break;
    case Channel::output_acceleration:
      at.output_acceleration = other.output_acceleration;
      break;
    case Channel::motor_position:
      at.motor_position = other.motor_position;
      at.wave_generator_on_flexspline = other.wave_generator_on_flexspline;
      at.wave_generator_on_circular_spline = other.wave_generator_on_circular_spline;
      break;
    case Channel::temperature:
      at.temperature = other.temperature;
      break;
    case Channel::load:
      at.load = other.load;
      break;
    case Channel::motor_torque:
      at.motor_torque = other.motor_torque;
      break;
    case Channel::period:
      at.period = other.period;
      break;
  }
}

constexpr std::array<Channel, 8> channels{Channel::output_position,     Channel::output_velocity,
                                          Channel::output_acceleration, Channel::motor_position,
                                          Channel::temperature,         Channel::load,
                                          Channel::motor_torque,        Channel::period};

}  // namespace

TEST_CASE_TEMPLATE("every effect has a name of its own, targets, a source, terms", S, float,
                   double) {
  std::set<std::string_view> names;
  for_each_effect<S>([&]<typename Effect>(const Effect& effect) {
    CHECK(names.insert(effect.name).second);
    CHECK_FALSE(effect.targets.empty());
    CHECK_FALSE(effect.source.empty());
    CHECK_FALSE(effect.signature.empty());
    CHECK_FALSE(effect.terms.empty());
    CHECK(effect.targets.find_first_not_of("SMD") == std::string_view::npos);
  });
}

TEST_CASE_TEMPLATE("every row can be had without exceptions and by the compiler", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect&) {
    static_assert(noexcept(row_of(std::declval<const Effect&>(), std::declval<const Sample<S>&>(),
                                  std::declval<StateOf<Effect>&>())));
    if constexpr (Remembers<Effect>) {
      static_assert(std::is_trivially_copyable_v<StateOf<Effect>>);
      static_assert(noexcept(std::declval<const Effect&>().settled(StateOf<Effect>{})));
    }
    static_assert(row_by_the_compiler<S, Effect>().size() == width_of<S, Effect>);
  });
}

TEST_CASE_TEMPLATE("a row depends on the channels that it names and on no other", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect& each) {
    for_each_path(each, [](const Effect& effect) {
      CAPTURE(effect.name);
      std::mt19937_64 random(21);
      for (const Channel channel : channels) {
        bool changed = false;
        for (int i = 0; i < 100; ++i) {
          const auto first = usual_sample<S>(random);
          auto at = usual_sample<S>(random);
          at.output_velocity *= S(0.001);
          const auto before = second_row<S>(effect, first, at);
          disturb(at, channel, random);
          changed |= second_row<S>(effect, first, at) != before;
        }
        CHECK(changed == reads_now(effect, channel));
      }
    });
  });
}

TEST_CASE_TEMPLATE("what carries load does not read it", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect&) {
    if (CarriesLoad<Effect>) CHECK_FALSE(reads<Effect>(Channel::load));
  });
}

TEST_CASE_TEMPLATE("a torque is linear in the coefficients", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(22);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 100; ++i) {
      const auto at = usual_sample<S>(random);
      const auto first = usual_sample<S>(random);
      Part<S, Effect> one{effect}, other{effect}, both{effect}, twice{effect};
      S size = 0;
      const auto row = second_row<S>(effect, first, at);
      const auto torque = [&](const Part<S, Effect>& part) {
        return weighted<S>(second_row<S>(part.effect, first, at), part.coefficients);
      };
      for (std::size_t k = 0; k < row.size(); ++k) {
        one.coefficients[k] = S(normal(random));
        other.coefficients[k] = S(normal(random));
        both.coefficients[k] = one.coefficients[k] + other.coefficients[k];
        twice.coefficients[k] = 2 * one.coefficients[k];
        size += math::absolute(row[k]) *
                (math::absolute(one.coefficients[k]) + math::absolute(other.coefficients[k]));
      }
      CHECK(torque(twice) == 2 * torque(one));
      // each of 2n products and sums, twice, rounds once
      const S bound = size * std::numeric_limits<S>::epsilon() * S(2 * row.size() + 2);
      CHECK(math::absolute(torque(both) - torque(one) - torque(other)) <= bound);
    }
  });
}

TEST_CASE_TEMPLATE("rows are finite for any finite sample whose powers are", S, float, double) {
  const S cube_root = sizeof(S) == 4 ? S(1e12) : S(1e102);
  for_each_effect<S>([&]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(23);
    StateOf<Effect> state;
    for (int i = 0; i < 20000; ++i) {
      auto at = any_sample<S>(random);
      at.output_velocity = math::clamp(at.output_velocity, -cube_root, cube_root);
      at.temperature = math::clamp(at.temperature, -cube_root, cube_root);
      for (const S value : row_of<S>(effect, at, state)) CHECK(math::is_finite(value));
    }
  });
}

TEST_CASE_TEMPLATE("friction is odd in velocity", S, float, double) {
  check_odd_in_velocity<S>(CoulombFriction<S>{});
  check_odd_in_velocity<S>(ViscousFriction<S>{});
  check_odd_in_velocity<S>(NonlinearViscousFriction<S>{});
  check_odd_in_velocity<S>(StribeckFriction<S>{});
  check_odd_in_velocity<S>(LoadDependentFriction<S>{});
}

TEST_CASE_TEMPLATE("friction is zero at standstill", S, float, double) {
  const auto check = [](const auto& effect) {
    for (const S value : row_at_velocity<S>(effect, 0)) CHECK(value == S(0));
  };
  check(CoulombFriction<S>{});
  check(ViscousFriction<S>{});
  check(NonlinearViscousFriction<S>{});
  check(StribeckFriction<S>{});
  check(LoadDependentFriction<S>{});
  CHECK(row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, 0) == Row<S, 2>{S(0.5), S(0.5)});
}

TEST_CASE_TEMPLATE("far above its width the direction is one", S, float, double) {
  for (const S v : {S(0.2), S(1), S(1e30), std::numeric_limits<S>::max()}) {
    CHECK(row_at_velocity<S>(CoulombFriction<S>{}, v)[0] == S(1));
    CHECK(row_at_velocity<S>(CoulombFriction<S>{}, -v)[0] == S(-1));
    CHECK(row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, v) == Row<S, 2>{S(1), S(0)});
    CHECK(row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, -v) == Row<S, 2>{S(0), S(1)});
    CHECK(row_at_velocity<S>(LoadDependentFriction<S>{}, v)[0] == S(40));
  }
}

TEST_CASE_TEMPLATE("the two directions add up to one", S, float, double) {
  std::mt19937_64 random(24);
  for (int i = 0; i < 1000; ++i) {
    const S velocity = S(0.01 * std::normal_distribution<double>()(random));
    const auto row = row_at_velocity<S>(CoulombFrictionPerDirection<S>{}, velocity);
    CHECK(math::absolute(row[0] + row[1] - 1) <= std::numeric_limits<S>::epsilon());
  }
}

TEST_CASE_TEMPLATE("Stribeck friction has faded far above its velocity", S, float, double) {
  const StribeckFriction<S> effect{S(0.1), S(0.005)};
  for (const S v : {S(10), S(1e10), std::numeric_limits<S>::max()}) {
    CHECK(row_at_velocity<S>(effect, v)[0] <= S(2e-22));
    CHECK(row_at_velocity<S>(effect, v)[0] > S(1e-22));
  }
  const S at_one = row_at_velocity<S>(effect, S(0.1))[0];
  CHECK(at_one == doctest::Approx(std::exp(-1.0)).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("without load nothing depends on load", S, float, double) {
  std::mt19937_64 random(25);
  auto at = usual_sample<S>(random);
  at.load = 0;
  CHECK(LoadDependentFriction<S>{}.row(at)[0] == S(0));
  CHECK(GainError<S>{}.row(at)[0] == S(0));
  at.load = S(-3);
  CHECK(GainError<S>{}.row(at)[0] == S(-3));
}

TEST_CASE_TEMPLATE("constants, gravity and temperature at their edges", S, float, double) {
  Sample<S> at;
  CHECK(Offset<S>{}.row(at) == Row<S, 1>{S(1)});
  CHECK(TemperatureDrift<S>{}.row(at) == Row<S, 2>{S(0), S(0)});
  at.temperature = S(27);
  CHECK(TemperatureDrift<S>{}.row(at) == Row<S, 2>{S(2), S(4)});
  CHECK(Gravity<S>{}.row(at) == Row<S, 2>{S(0), S(1)});
  at.output_position = Angle<S>::from_turns(S(5.25));
  CHECK(Gravity<S>{}.row(at) == Row<S, 2>{S(1), S(0)});
  at.output_acceleration = S(-2);
  CHECK(Inertia<S>{}.row(at) == Row<S, 1>{S(-2)});
}

TEST_CASE_TEMPLATE("shapes lie within their bounds", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    if constexpr (requires { effect.shapes(); }) {
      for (const auto& shape : effect.shapes()) {
        CHECK(effect.*shape.field >= shape.lower);
        CHECK(effect.*shape.field <= shape.upper);
        CHECK_FALSE(shape.unit.empty());
      }
    }
  });
}

TEST_CASE_TEMPLATE("the mesh yields in proportion first and stiffens, against the torque", S, float,
                   double) {
  const MeshCompliance<S> effect{S(0.05)};
  const auto row = [&](S load) {
    Sample<S> at;
    at.load = load;
    return effect.row(at)[0];
  };
  CHECK(row(0) == S(0));
  CHECK(row(S(0.01)) == doctest::Approx(-0.01).epsilon(1e-6));
  CHECK(row(S(20)) == doctest::Approx(-std::atan(1.0) / 0.05).epsilon(1e-6));
  CHECK(row(S(1e30)) == doctest::Approx(-1.5707963267948966 / 0.05).epsilon(1e-6));
  CHECK(row(S(-20)) == -row(S(20)));
}

TEST_CASE_TEMPLATE("the wave generator yields to its stop, against the motor's torque", S, float,
                   double) {
  const WaveGeneratorCompliance<S> effect{S(3)};
  const auto row = [&](S torque) {
    Sample<S> at;
    at.motor_torque = torque;
    return effect.row(at)[0];
  };
  CHECK(row(0) == S(0));
  CHECK(row(S(1e-4)) == doctest::Approx(-1e-4).epsilon(2e-4));
  CHECK(row(S(0.4)) == doctest::Approx(std::expm1(-1.2) / 3).epsilon(1e-6));
  CHECK(row(S(1e30)) == S(-1) / S(3));
  CHECK(row(S(-0.4)) == -row(S(0.4)));
}

TEST_CASE_TEMPLATE("springs that slip follow the path and forget nothing but their overrun", S,
                   float, double) {
  TorsionalHysteresis<S> effect;
  effect.load_width = S(8);
  typename TorsionalHysteresis<S>::State state;
  const auto row = [&](S load) {
    Sample<S> at;
    at.load = load;
    return effect.row(at, state);
  };
  CHECK(row(S(5)) == Row<S, 4>{0, 0, 0, 0});  // the first sample is the start, wherever it is
  CHECK(row(S(6)) == Row<S, 4>{S(0.125), S(0.25), S(0.5), S(1)});
  CHECK(row(S(9)) == Row<S, 4>{S(0.5), S(1), S(1), S(1)});
  CHECK(row(S(7)) == Row<S, 4>{S(0.25), S(0.5), S(0), S(-1)});
  CHECK_FALSE(effect.settled(state));
  CHECK(row(S(20)) == Row<S, 4>{S(1), S(1), S(1), S(1)});
  CHECK_FALSE(effect.settled(state));  // 5 to 20 is less than twice the width
  CHECK(row(S(21)) == Row<S, 4>{S(1), S(1), S(1), S(1)});
  CHECK(effect.settled(state));
  const auto saved = state;
  const auto next = row(S(17));
  state = saved;
  CHECK(row(S(17)) == next);
}

TEST_CASE_TEMPLATE("on the motor's path the way counts over whole turns, the other way round", S,
                   float, double) {
  TorsionalHysteresis<S> effect;
  effect.path = S(1);
  effect.angle_width = S(16);
  typename TorsionalHysteresis<S>::State state;
  S last = 0;
  for (int i = 0; i <= 40; ++i) {  // five turns in steps of an eighth
    Sample<S> at;
    at.motor_position = Angle<S>::from_turns(S(i) / S(8));
    at.motor_position.turns = 0;  // the phase alone counts, as in a batch
    last = effect.row(at, state)[0];
    CHECK(last == doctest::Approx(-std::min(i / 8.0 * 6.283185307179586 / 16, 1.0)).epsilon(1e-5));
  }
  CHECK(last == S(-1));
}

TEST_CASE_TEMPLATE("a loop of hysteresis costs energy on either path", S, float, double) {
  TorsionalHysteresis<S> effect;
  for (const S path : {S(0), S(1)}) {
    effect.path = path;
    typename TorsionalHysteresis<S>::State state;
    std::array<S, 4> work{};
    for (int i = 0; i <= 400; ++i) {
      Sample<S> at;
      const double swing = 0.4 * std::sin(2 * 3.141592653589793 * i / 200);
      at.load = S(60 * swing);
      at.motor_position = Angle<S>::from_turns(S(swing));
      // by the load: ∮ Δθ dτ < 0 lags; by the motor: −∮ Δθ dθ > 0 is what friction takes
      const S driven =
          path == S(0) ? at.load - state.load : (at.motor_position.phase - state.motor).shortest();
      const auto row = effect.row(at, state);
      for (std::size_t k = 0; k < 4 && i > 200; ++k) work[k] += row[k] * driven;
    }
    for (const S w : work) CHECK((path == S(0) ? w : -w) > S(0));
  }
}
