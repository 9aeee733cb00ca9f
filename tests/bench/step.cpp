// Nanoseconds for one sample: encoder in, velocity and acceleration, model, torque out.
//
// Prints a line for each precision and number of harmonics: median and worst of batches of a
// thousand steps, then median, 99.9 % and worst of steps timed one by one (with the clock's own
// time, printed last).
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "flexspline/effects/catalogue.hpp"
#include "flexspline/estimators/differentiator.hpp"
#include "flexspline/model.hpp"

namespace {

using namespace flexspline;
using Clock = std::chrono::steady_clock;

constexpr std::size_t batch = 1000;
constexpr std::size_t batches = 2000;

double nanoseconds(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::nano>(to - from).count();
}

template <typename S, std::size_t N>
using Joint =
    Model<S, Offset<S>, CoulombFriction<S>, ViscousFriction<S>, StribeckFriction<S>, Inertia<S>,
          Gravity<S>, LoadDependentFriction<S>, TemperatureDrift<S>, OutputRipple<S, N>>;

template <typename S, std::size_t N>
Joint<S, N> joint() {
  Joint<S, N> model;
  std::apply([](auto&... part) { (part.coefficients.fill(S(0.1)), ...); }, model.parts);
  auto& ripple = std::get<Part<S, OutputRipple<S, N>>>(model.parts).effect;
  std::array<Harmonic, N> harmonics;
  for (std::size_t k = 0; k < N; ++k) harmonics[k].order = static_cast<std::uint32_t>(k + 1);
  ripple.assign(harmonics);
  return model;
}

/// One joint's step with what it remembers.
template <typename S, std::size_t N>
struct Device {
  Joint<S, N> model = joint<S, N>();
  typename Differentiator<S>::State motion;
  Sample<S> at;
  S torque = 0;

  Status step(S radians) noexcept {
    if (const Status read = read_radians(radians, at.output_position); read != Status::ok) {
      return read;
    }
    const Status moved = Differentiator<S>::step({}, motion, at.output_position.phase, S(0.001));
    if (moved != Status::ok) return moved;
    at.output_velocity = motion.velocity;
    at.output_acceleration = motion.acceleration;
    return model.predict(at, torque);
  }
};

double at(std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

template <typename S, std::size_t N>
void measure(const char* precision) {
  std::vector<S> position(batch);
  for (std::size_t i = 0; i < batch; ++i) {
    position[i] = static_cast<S>(2.0 * std::sin(0.002 * static_cast<double>(i)));
  }
  Device<S, N> device;
  int flagged = 0;
  double sum = 0;
  std::vector<double> means, singles;
  for (std::size_t b = 0; b < batches; ++b) {
    const auto start = Clock::now();
    for (const S q : position) {
      flagged += device.step(q) != Status::ok;
      sum += static_cast<double>(device.torque);
    }
    means.push_back(nanoseconds(start, Clock::now()) / static_cast<double>(batch));
  }
  for (std::size_t b = 0; b < batches / 10; ++b) {
    for (const S q : position) {
      const auto start = Clock::now();
      flagged += device.step(q) != Status::ok;
      singles.push_back(nanoseconds(start, Clock::now()));
    }
  }
  std::sort(means.begin(), means.end());
  std::sort(singles.begin(), singles.end());
  std::printf("%s %zu %.1f %.1f %.0f %.0f %.0f %d %g\n", precision, N, at(means, 0.5), means.back(),
              at(singles, 0.5), at(singles, 0.999), singles.back(), flagged, sum);
}

template <typename S>
void measure_all(const char* precision) {
  measure<S, 4>(precision);
  measure<S, 10>(precision);
  measure<S, 20>(precision);
}

double clock_time() {
  std::vector<double> times;
  for (int i = 0; i < 100000; ++i) {
    const auto start = Clock::now();
    times.push_back(nanoseconds(start, Clock::now()));
  }
  std::sort(times.begin(), times.end());
  return at(times, 0.5);
}

}  // namespace

int main() {
  measure_all<float>("float");
  measure_all<double>("double");
  std::printf("clock %.0f\n", clock_time());
}
