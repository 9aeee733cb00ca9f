// Rows in, results out, one step each: the same program on a host and on a device.
#include "board.hpp"
#include "unit.hpp"

namespace {

constexpr std::size_t block = 1024;  // rows at a time: an emulator's files are slow to reach

using Row = certify::Row<unit::Scalar>;
using Result = certify::Result<unit::Scalar>;

constinit std::array<Row, block> rows{};
constinit std::array<Result, block> results{};

/// Ticks that the readings of the clock themselves take.
std::uint32_t clock_alone() noexcept {
  board::start();
  return board::stop();
}

std::uint32_t run(std::size_t count, std::uint32_t alone) noexcept {
  board::paint();
  for (std::size_t k = 0; k < count; ++k) {
    unit::take(rows[k]);
    board::start();
    const flexspline::Status status = flexspline_step();
    const std::uint32_t ticks = board::stop() - alone;
    unit::give(results[k]);
    results[k].status = static_cast<std::uint8_t>(status);
    results[k].ticks = ticks;
  }
  return board::painted_over();
}

}  // namespace

int main() {
  const std::uint32_t alone = clock_alone();
  certify::Footer footer{};
  for (;;) {
    const std::size_t count = board::read(rows.data(), sizeof rows) / sizeof(Row);
    if (count == 0) break;
    const std::uint32_t used = run(count, alone);
    if (used > footer.stack_bytes) footer.stack_bytes = used;
    if (!board::write(results.data(), count * sizeof(Result))) return 1;
  }
  return board::write(&footer, sizeof footer) ? 0 : 1;
}
