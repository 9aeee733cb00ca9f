// A block replaces all parameters or none.
#include <doctest/doctest.h>

#include <string_view>
#include <thread>
#include <vector>

#include "flexspline/effects/output_ripple.hpp"
#include "flexspline/effects/presliding_friction.hpp"
#include "flexspline/effects/stribeck_friction.hpp"
#include "flexspline/effects/viscous_friction.hpp"
#include "flexspline/swap.hpp"

using namespace flexspline;

namespace {

template <typename S>
using Ripple = OutputRipple<S, 2>;
template <typename S>
using Friction = flexspline::Model<S, StribeckFriction<S>, Ripple<S>>;
template <typename S>
using Whole =
    Joint<S, Friction<S>, flexspline::Model<S>, flexspline::Model<S>, flexspline::Model<S>>;

template <typename S>
Friction<S> friction(S level) {
  Friction<S> made{Gear<S>::from_ratio(101, OutputSpline::circular, false), {}};
  auto& [stribeck, ripple] = made.parts;
  stribeck.effect.stribeck_velocity = level;
  stribeck.coefficients = {level};
  ripple.effect = {{{{{2, Pair::output_on_housing}, {4200, Pair::output_on_housing}}}}};
  ripple.coefficients = {level, level, level, level};
  return made;
}

/// Every stage, each with numbers that differ from the defaults.
template <typename S>
Whole<S> whole(S level) {
  using Chain = flexspline::Chain<S>;
  Whole<S> made{};
  made.sensing.checks = typename ReadingChecks<S>::Config{level, level};
  made.sensing.checks->gear = Gear<S>::from_ratio(101, OutputSpline::flex, true);
  made.sensing.differentiator = typename Differentiator<S>::Config{level};
  made.sensing.thermistor = Thermistor<S>{level, level, level, level, level};
  made.sensing.compensation = typename Chain::Compensation::Config{level, {level}, level, level};
  made.sensing.sensor = true;
  made.sensing.calibration = Calibration<S>{level, level};
  made.estimating.observer = typename Chain::Observer::Config{level};
  made.estimating.compliance = Compliance<S>{level, level};
  made.estimating.hysteresis = LoadHysteresis<S>{level};
  made.estimating.compliant_observer = typename Chain::Observer::Config{level};
  made.estimating.kalman = typename Chain::Kalman::Config{{level, level}, level, level, level};
  made.estimating.collision = typename Chain::Detector::Config{};
  made.estimating.collision->negative[0] = level;
  auto& adaptation = made.estimating.adaptation.emplace();
  adaptation.noise = adaptation.memory = adaptation.interval = level;
  adaptation.low[0] = -level;
  adaptation.high[7] = adaptation.factor[35] = level;
  made.sensor = friction<S>(level);
  made.inertia = level;
  made.limits.output_velocity = made.limits.time = S(100) * level;
  return made;
}

template <typename T>
std::vector<std::uint8_t> saved(const T& joint) {
  std::vector<std::uint8_t> bytes(block_size(joint));
  std::size_t size = 0;
  REQUIRE(save(joint, bytes, size) == BlockStatus::ok);
  REQUIRE(size == bytes.size());
  return bytes;
}

void put(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint32_t value) {
  REQUIRE(at + 4 <= bytes.size());
  block::write(std::span(bytes), at, value);
}

/// Puts a fitting CRC behind changed bytes.
void sign(std::vector<std::uint8_t>& bytes) {
  REQUIRE(bytes.size() >= block::head + block::tail);
  Crc32 crc;
  crc.add(Bytes(bytes).first(bytes.size() - 4));
  put(bytes, bytes.size() - 4, crc.value());
}

}  // namespace

TEST_CASE("the CRC is that of zlib") {
  Crc32 crc;
  for (const char letter : std::string_view("123456789")) crc.add(std::uint8_t(letter));
  CHECK(crc.value() == 0xCBF43926u);
}

TEST_CASE_TEMPLATE("what is saved is loaded, number by number", S, float, double) {
  const auto bytes = saved(whole(S(0.7L)));
  Whole<S> joint = whole(S(0.2L));
  REQUIRE(saved(joint) != bytes);
  CHECK(load(bytes, joint) == BlockStatus::ok);
  CHECK(saved(joint) == bytes);
  CHECK(joint.estimating.kalman->motion.alpha == S(0.7L));
  CHECK(std::get<1>(joint.sensor.parts).effect.harmonics()[1].order == 4200);
  CHECK(joint.limits.output_velocity == S(100) * S(0.7L));
  CHECK(joint.estimating.adaptation->factor[35] == S(0.7L));
}

TEST_CASE("a block that any single bit differs from is refused, and changes nothing") {
  auto bytes = saved(whole(0.7F));
  Whole<float> joint = whole(0.2F);
  const auto before = saved(joint);
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const auto mask = static_cast<std::uint8_t>(1U << (bit % 8));
    bytes[bit / 8] ^= mask;
    CHECK(load(bytes, joint) != BlockStatus::ok);
    bytes[bit / 8] ^= mask;
  }
  CHECK(saved(joint) == before);
}

TEST_CASE("a block that ends too early is truncated; what lies behind it does not matter") {
  auto bytes = saved(whole(0.7));
  Whole<double> joint = whole(0.2);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    CHECK(load(Bytes(bytes).first(size), joint) == BlockStatus::truncated);
  }
  bytes.resize(bytes.size() + 100, 0xFF);
  CHECK(load(bytes, joint) == BlockStatus::ok);
}

TEST_CASE("each reason to refuse a block has its status") {
  Whole<float> joint = whole(0.2F);
  const auto good = saved(whole(0.7F));
  const auto refused = [&](auto change) {
    auto bytes = good;
    change(bytes);
    sign(bytes);
    return load(bytes, joint);
  };
  CHECK(refused([](std::vector<std::uint8_t>& bytes) { bytes[0] = 'X'; }) ==
        BlockStatus::not_a_block);
  CHECK(refused([](std::vector<std::uint8_t>& bytes) { bytes[4] = 0; }) == BlockStatus::older);
  CHECK(refused([](std::vector<std::uint8_t>& bytes) { bytes[4] = block::version + 1; }) ==
        BlockStatus::newer);
  CHECK(refused([](std::vector<std::uint8_t>& bytes) { bytes[8] ^= 1; }) ==
        BlockStatus::other_structure);
  CHECK(refused([](std::vector<std::uint8_t>& bytes) { put(bytes, 16, 0x7FC00000U); }) ==
        BlockStatus::out_of_range);
  CHECK(refused([](std::vector<std::uint8_t>& bytes) { put(bytes, 16, 0x7F800000U); }) ==
        BlockStatus::out_of_range);
  CHECK(load(saved(whole(0.7)), joint) == BlockStatus::other_scalar);
  CHECK(load(saved(friction(0.7F)), joint) == BlockStatus::other_structure);
  auto other_rule = whole(0.7F);
  other_rule.estimating.observer->discretisation = Discretisation::euler;
  CHECK(load(saved(other_rule), joint) == BlockStatus::other_structure);
  auto other_use = whole(0.7F);
  other_use.estimating.adaptation->use = AdaptationUse::compensate;
  CHECK(load(saved(other_use), joint) == BlockStatus::other_structure);
  std::size_t size = 0;
  std::array<std::uint8_t, 20> little{};
  CHECK(save(joint, little, size) == BlockStatus::no_room);
  CHECK(saved(joint) == saved(whole(0.2F)));
}

namespace {

/// The block as version 1 wrote it, without the limits of readings.
template <typename T>
std::vector<std::uint8_t> without_limits(const T& joint) {
  auto bytes = saved(joint);
  block::Outline<typename parameters::ScalarOf<T>::type> outline;
  parameters::visit_unlimited(outline, joint);
  bytes.resize(block::head + outline.size + block::tail);
  bytes[4] = 1;
  put(bytes, 8, outline.crc.value());
  put(bytes, 12, static_cast<std::uint32_t>(outline.size));
  sign(bytes);
  return bytes;
}

}  // namespace

TEST_CASE_TEMPLATE("a block of version 1 is read, and its limits are those of any joint", S, float,
                   double) {
  Whole<S> joint = whole(S(0.2L));
  REQUIRE(load(without_limits(whole(S(0.7L))), joint) == BlockStatus::ok);
  Whole<S> expected = whole(S(0.7L));
  expected.limits = {};
  CHECK(saved(joint) == saved(expected));
}

TEST_CASE("a block that version 1 wrote is read") {
  constexpr std::array<std::uint8_t, 64> written{
      0x46, 0x4c, 0x58, 0x4a, 0x01, 0x04, 0x00, 0x00, 0x39, 0x06, 0x9d, 0x98, 0x2c,
      0x00, 0x00, 0x00, 0x65, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
      0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
      0x3f, 0x0a, 0xd7, 0x23, 0x3c, 0x00, 0x00, 0x80, 0x3e, 0x00, 0x00, 0x00, 0x3e,
      0x00, 0x00, 0x80, 0x3d, 0x00, 0x00, 0x80, 0x3f, 0xc1, 0x54, 0xe6, 0x3e};
  flexspline::Model<float, ViscousFriction<float>, PreslidingFriction<float>> model{};
  model.limits.most = {3.0F};
  REQUIRE(load(written, model) == BlockStatus::ok);
  const auto& [viscous, presliding] = model.parts;
  CHECK(model.gear.whole_ratio == 101);
  CHECK(viscous.coefficients[0] == 0.5F);
  CHECK(presliding.effect.presliding_width == 0.01F);
  CHECK(presliding.coefficients == std::array{0.25F, 0.125F, 0.0625F, 1.0F});
  CHECK(model.limits.most[0] == ReadingLimits<float>{}.output_velocity);
  CHECK(saved(model) != std::vector<std::uint8_t>(written.begin(), written.end()));
}

TEST_CASE("limits that are no limits are refused") {
  Whole<float> joint = whole(0.2F);
  const auto before = saved(joint);
  for (const float wrong : {0.0F, -1.0F, std::numeric_limits<float>::quiet_NaN(),
                            std::numeric_limits<float>::infinity()}) {
    Whole<float> other = whole(0.7F);
    other.limits.motor_torque = wrong;
    CHECK(load(saved(other), joint) == BlockStatus::out_of_range);
  }
  CHECK(saved(joint) == before);
}

TEST_CASE("new parameters wait until the loop has taken the last ones") {
  Swap<Friction<float>> swap{friction(0.2F)};
  const auto level = [&] { return std::get<0>(swap.take().parts).coefficients[0]; };
  CHECK(swap.load(saved(friction(0.7F))) == BlockStatus::ok);
  CHECK(swap.load(saved(friction(0.9F))) == BlockStatus::busy);
  CHECK(level() == 0.7F);
  CHECK(swap.load(Bytes{}) == BlockStatus::truncated);
  CHECK(level() == 0.7F);
  CHECK(swap.load(saved(friction(0.9F))) == BlockStatus::ok);
  CHECK(level() == 0.9F);
}

TEST_CASE("a loop never sees parameters of two blocks at once") {
  Swap<Friction<double>> swap{friction(0.25)};
  const std::array blocks{saved(friction(0.25)), saved(friction(0.75))};
  std::atomic<bool> done{false};
  std::thread loader([&] {
    for (int k = 0; k < 500;) {
      k += swap.load(blocks[std::size_t(k % 2)]) == BlockStatus::ok;
      std::this_thread::yield();
    }
    done = true;
  });
  int mixed = 0;
  while (!done) {
    const auto& [stribeck, ripple] = swap.take().parts;
    mixed += stribeck.coefficients[0] != ripple.coefficients[3];
    mixed += stribeck.coefficients[0] != stribeck.effect.stribeck_velocity;
    std::this_thread::yield();
  }
  loader.join();
  CHECK(mixed == 0);
}
