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
  return effect.row(at);
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
  }
}

constexpr std::array<Channel, 6> channels{Channel::output_position,     Channel::output_velocity,
                                          Channel::output_acceleration, Channel::motor_position,
                                          Channel::temperature,         Channel::load};

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
    static_assert(noexcept(std::declval<Effect>().row(std::declval<Sample<S>>())));
    static_assert(row_by_the_compiler<S, Effect>().size() == width_of<S, Effect>);
  });
}

TEST_CASE_TEMPLATE("a row depends on the channels that it names and on no other", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(21);
    for (const Channel channel : channels) {
      bool changed = false;
      for (int i = 0; i < 100; ++i) {
        auto at = usual_sample<S>(random);
        at.output_velocity *= S(0.001);
        const auto before = effect.row(at);
        disturb(at, channel, random);
        changed |= effect.row(at) != before;
      }
      CHECK(changed == reads<Effect>(channel));
    }
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
      Part<S, Effect> one{effect}, other{effect}, both{effect}, twice{effect};
      S size = 0;
      const auto row = effect.row(at);
      for (std::size_t k = 0; k < row.size(); ++k) {
        one.coefficients[k] = S(normal(random));
        other.coefficients[k] = S(normal(random));
        both.coefficients[k] = one.coefficients[k] + other.coefficients[k];
        twice.coefficients[k] = 2 * one.coefficients[k];
        size += math::absolute(row[k]) *
                (math::absolute(one.coefficients[k]) + math::absolute(other.coefficients[k]));
      }
      CHECK(twice.torque(at) == 2 * one.torque(at));
      // each of 2n products and sums, twice, rounds once
      const S bound = size * std::numeric_limits<S>::epsilon() * S(2 * row.size() + 2);
      CHECK(math::absolute(both.torque(at) - one.torque(at) - other.torque(at)) <= bound);
    }
  });
}

TEST_CASE_TEMPLATE("rows are finite for any finite sample whose powers are", S, float, double) {
  const S cube_root = sizeof(S) == 4 ? S(1e12) : S(1e102);
  for_each_effect<S>([&]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(23);
    for (int i = 0; i < 20000; ++i) {
      auto at = any_sample<S>(random);
      at.output_velocity = math::clamp(at.output_velocity, -cube_root, cube_root);
      at.temperature = math::clamp(at.temperature, -cube_root, cube_root);
      for (const S value : effect.row(at)) CHECK(math::is_finite(value));
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
