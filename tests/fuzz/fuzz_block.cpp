// Any bytes as a block of parameters: two bytes of choices of the joint, one of the precision and
// of what the rest is: a block as it stands, or bits that differ from a good block's numbers,
// signed with a fitting CRC, and readings behind them. What is refused must change nothing, what is
// taken must be in range, and must step without breaking a law.
#include <algorithm>
#include <vector>

#include "flexspline/block.hpp"
#include "step_invariants.hpp"
#include "whole_joint.hpp"

namespace {

using namespace flexspline;
using namespace flexspline::fuzz;

using Block = std::vector<std::uint8_t>;

/// Every number of a joint against its range, by the joint's own memory and not the block's bytes.
template <typename S>
struct InRange {
  bool good = true;

  void structure(std::string_view) {}
  void numbers(std::string_view, const S* first, std::size_t count, Range<S> range) {
    for (std::size_t k = 0; k < count; ++k) {
      good = good && first[k] >= range.low && first[k] <= range.high;
    }
  }
  void harmonic(const Harmonic& h) {
    good = good && h.order > 0 && h.pair <= Pair::wave_generator_on_circular_spline;
  }
  void gear(const Gear<S>& g) {
    good = good && g.whole_ratio <= (1U << 30) && g.output <= OutputSpline::flex;
  }
};

template <typename T>
Block saved(const T& joint) {
  Block bytes(block_size(joint));
  std::size_t size = 0;
  require(save(joint, bytes, size) == BlockStatus::ok && size == bytes.size(), "a joint is saved");
  return bytes;
}

/// A good block whose numbers differ by the bits of the source.
template <typename T>
Block changed(const T& joint, Source& source) {
  Block bytes = saved(joint);
  const std::size_t last = bytes.size() - block::tail;
  const std::size_t count = source.take<std::uint16_t>();
  for (std::size_t k = 0; k < count && block::head + k < last && !source.empty(); ++k) {
    bytes[block::head + k] ^= source.take<std::uint8_t>();
  }
  Crc32 crc;
  crc.add(Bytes(bytes).first(last));
  block::write(std::span(bytes), last, crc.value());
  return bytes;
}

/// A block of the first version has no limits of readings: they are those of any joint.
template <typename S>
void require_taken(const WholeJoint<S>& joint, const Block& given) {
  const Block after = saved(joint);
  if (given[4] == block::version) {
    require(std::equal(after.begin(), after.end(), given.begin()), "what is taken is all there");
    return;
  }
  block::Outline<S> old;
  parameters::visit_unlimited(old, joint);
  const auto numbers = [&old](const Block& of) { return Bytes(of).subspan(block::head, old.size); };
  require(std::ranges::equal(numbers(after), numbers(given)), "what is taken is all there");
  auto other = joint;
  other.limits = {};
  require(saved(other) == after, "the limits are those of any joint");
}

template <typename S>
void run(std::uint16_t choice, bool as_it_stands, Source& source) {
  WholeJoint<S> joint = whole_joint<S>(choice);
  const Block before = saved(joint);
  const Block given =
      as_it_stands ? Block(source.rest().begin(), source.rest().end()) : changed(joint, source);
  if (load(given, joint) != BlockStatus::ok) {
    require(saved(joint) == before, "what is refused changes nothing");
    return;
  }
  InRange<S> check;
  parameters::visit(check, std::as_const(joint));
  require(check.good, "what is taken is in range");
  require_taken(joint, given);
  typename WholeJoint<S>::State state;
  typename WholeJoint<S>::Chain::Output out;
  checked_run<S>(joint, state, out, source);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  const auto choice = source.take<std::uint16_t>();
  const auto how = source.take<std::uint8_t>();
  const bool as_it_stands = (how & 2) != 0;
  if ((how & 1) != 0) {
    run<double>(choice, as_it_stands, source);
  } else {
    run<float>(choice, as_it_stands, source);
  }
  return 0;
}
