// The parameters of exported joints and models as blocks: their own ones out, others in.
//
//   block float|double NAME < nothing > its own block
//   block float|double NAME < a block > status of loading it (one byte), then its block after that
//
// `MODELS(X)` is X of the name of each exported header (of its namespace), all of which `models.hpp`
// includes, and of what it holds: `joint` or `model`.
#include "flexspline/block.hpp"

#include <cstdio>
#include <cstring>
#include <vector>

#include "models.hpp"
#include "saved.hpp"

namespace {

template <typename T>
int answer(T made) {
  std::vector<std::uint8_t> given(1 << 16);
  given.resize(std::fread(given.data(), 1, given.size(), stdin));
  if (!given.empty()) {
    const auto status = static_cast<std::uint8_t>(flexspline::load(given, made));
    if (std::fwrite(&status, 1, 1, stdout) != 1) return 1;
  }
  return write_block(made);
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) return 2;
  const bool single = std::strcmp(arguments[1], "float") == 0;
#define ANSWER(name, made)                                                  \
  if (std::strcmp(arguments[2], #name) == 0) {                              \
    return single ? answer(name::made<float>) : answer(name::made<double>); \
  }
  MODELS(ANSWER)
  return 2;
}
